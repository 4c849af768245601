"""One HTML file with a story in it: it asks nothing of any other file or server."""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from importlib.resources import files

from hmrf_icp.io.whole import written_whole
from hmrf_icp.view.packed import packed
from hmrf_icp.view.story import Story

SCRIPTS = ("looking.js", "drawing.js", "colours.js", "plots.js", "main.js")
"""In the order in which they are put together."""

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
"""What a browser may load for such a page: nothing that is not in it."""


def page(story: Story, links: Sequence[tuple[str, str]] = ()) -> str:
    """Write the page of a story.

    Parameters
    ----------
    story
        What it shows.
    links
        Addresses and words of links at the top.
    """
    head, block = packed(story)
    return filled(
        "page.html",
        title=html.escape(story.title),
        policy=POLICY,
        style=asset("theme.css") + asset("page.css"),
        links=anchors(links),
        head=head,
        block=block,
        script="\n".join(asset(name) for name in SCRIPTS),
    )


def anchors(links: Sequence[tuple[str, str]], here: str = "") -> str:
    """Write links; the one that leads ``here`` is marked."""
    each = (
        f'<a href="{html.escape(to)}"{" aria-current=page" if to == here else ""}>'
        f"{html.escape(words)}</a>"
        for to, words in links
    )
    return f"<nav>{' '.join(each)}</nav>" if links else ""


def write_html(story: Story, path: str | os.PathLike[str]) -> None:
    """Write the page of a story; the file appears whole or not at all.

    Raises
    ------
    InputError
        It cannot be written there.
    """
    with written_whole(path) as partial:
        partial.write_text(page(story), encoding="utf-8", errors="backslashreplace", newline="\n")


def asset(name: str) -> str:
    """Read one of the files that pages are made of."""
    return files("hmrf_icp.view").joinpath("assets").joinpath(name).read_text(encoding="utf-8")


def filled(name: str, **parts: str) -> str:
    """Put parts into a template, each once, in the order in which they stand in it."""
    text, rest = "", asset(name)
    for part, content in parts.items():
        before, mark, rest = rest.partition(f"{{{{ {part} }}}}")
        if not mark:
            raise ValueError(f"{name}: no place for {part}")
        text += before + content
    return text + rest
