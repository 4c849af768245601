"""Text of others, made fit for a line of a file that people open in other programs."""

from __future__ import annotations

from hmrf_icp.errors import InputError

LONGEST_NAME = 100

_FORMULA = ("=", "+", "-", "@")
"""A cell that begins so is worked out by a spreadsheet."""


def plain(text: str) -> str:
    """Return the text as one line of characters that can be printed and encoded.

    Line breaks become blanks. What stands for bytes that were no text (a lone surrogate) is
    written out, any other control character replaced.
    """
    line = " ".join(text.split())
    if line.isprintable():
        return line
    encoded = line.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in encoded)


def cell(text: str) -> str:
    """Return the text as `plain` does, marked as words where it looks like a formula."""
    line = plain(text)
    return f"'{line}" if line.startswith(_FORMULA) else line


def require_name(name: str) -> None:
    """Refuse what cannot be the name of a method in a file of results.

    Raises
    ------
    InputError
        It is empty or long, has line breaks, characters that are not printed or blanks at its
        ends, or looks like a formula.
    """
    if not name or name != plain(name) or len(name) > LONGEST_NAME or name.startswith(_FORMULA):
        raise InputError(
            f"methods: {name[: LONGEST_NAME + 20]!r} cannot be a name in results.csv; expected "
            f"one line of up to {LONGEST_NAME} printable characters that begins with none of "
            f"{' '.join(_FORMULA)} and has no blank at its ends"
        )
