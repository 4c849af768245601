"""The header of a PLY file: what its body holds, in which types and in which order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hmrf_icp.errors import InputError

ASCII = ""

_ORDERS = {"ascii": ASCII, "binary_little_endian": "<", "binary_big_endian": ">"}

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
"""NumPy's codes of the names of the original description, and of those that came after it."""

TYPE_NAMES = {code: name for name, code in reversed(_TYPES.items())}
"""The original name of each type, by NumPy's code."""

_LENGTHS = {name: code for name, code in _TYPES.items() if code[0] in "iu"}

_FORMS = {
    "format": "'format KIND 1.0' once, of " + ", ".join(_ORDERS),
    "element": "'element NAME COUNT', each name once",
    "property": "'property TYPE NAME' or 'property list TYPE TYPE NAME' after its element, each "
    "name once, of types such as " + ", ".join(list(_TYPES)[:8]),
}


@dataclass(frozen=True)
class Property:
    """One number in each row of an element, or a list of numbers with its length before it."""

    name: str
    code: str
    """NumPy's code of the number, without its byte order."""
    length: str | None = None
    """Code of the length of a list; None is a single number."""


@dataclass
class Element:
    """A table: ``count`` rows of the same properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    """Names of its properties: a header is asked for them at each of its lines."""

    def add(self, new: Property) -> None:
        """Append a property."""
        self.properties.append(new)
        self.names.add(new.name)

    @property
    def has_lists(self) -> bool:
        """Whether its rows may differ in length."""
        return any(each.length is not None for each in self.properties)


@dataclass(frozen=True)
class Header:
    """What the body holds and where it starts."""

    order: str
    """``<`` or ``>``, the order of the bytes, or `ASCII`."""
    elements: dict[str, Element]
    """By name, in the order of the file."""
    notes: list[list[str]]
    """The words of each obj_info, then of each comment."""
    body: int
    """Bytes before the body."""
    lines: int
    """Lines before the body."""


def parse_header(path: Path, data: bytes) -> Header:
    """Read the header at the front of ``data``, the bytes of a file.

    Raises
    ------
    InputError
        It is malformed, with the number of the line, or not that of a PLY file.
    """
    order: str | None = None
    elements: dict[str, Element] = {}
    notes: dict[str, list[list[str]]] = {"obj_info": [], "comment": []}
    current = Element("", 0)
    for number, line, end in _lines(path, data):
        match line.split():
            case ["end_header"]:
                if order is None:
                    raise InputError(f"{path}: the PLY header has no line {_FORMS['format']}")
                _refuse_empty_rows(path, elements)
                every_note = notes["obj_info"] + notes["comment"]
                return Header(order, elements, every_note, end, number)
            case ["ply"] if number == 1:
                pass
            case []:
                pass
            case [("comment" | "obj_info") as kind, *words]:
                notes[kind].append(words)
            case ["format", kind, "1.0"] if kind in _ORDERS and order is None:
                order = _ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and name not in elements:
                current = elements[name] = Element(name, int(count))
            case ["property", "list", length, kind, name] if (
                length in _LENGTHS and kind in _TYPES and elements and name not in current.names
            ):
                current.add(Property(name, _TYPES[kind], _LENGTHS[length]))
            case ["property", kind, name] if (
                kind in _TYPES and elements and name not in current.names
            ):
                current.add(Property(name, _TYPES[kind]))
            case [keyword, *_]:
                expected = _FORMS.get(keyword, ", ".join((*_FORMS, *notes, "end_header")))
                raise InputError(
                    f"{path}: line {number} of the PLY header is {line.strip()[:60]!r}, "
                    f"expected {expected}"
                )
    raise InputError(f"{path}: cut short: its PLY header has no line 'end_header'")


def _lines(path: Path, data: bytes) -> Iterator[tuple[int, str, int]]:
    """Lines with their number from 1 and where each ends, whichever system wrote them."""
    if data[:3] != b"ply" or data[3:4] not in b"\r\n \t":
        raise InputError(
            f"{path}: not a PLY file: it starts with {data[:12].decode('ascii', 'replace')!r}, "
            "expected 'ply'"
        )
    # The original description ends lines with a carriage return alone, as its own system did.
    alone = data[3:4] == b"\r" and data[4:5] != b"\n"
    mark = b"\r" if alone else b"\n"
    at, number = 0, 0
    while (end := data.find(mark, at)) >= 0:
        number += 1
        yield number, data[at:end].decode("ascii", "replace"), end + 1
        at = end + 1


def _refuse_empty_rows(path: Path, elements: dict[str, Element]) -> None:
    for element in elements.values():
        if element.count and not element.properties:
            raise InputError(
                f"{path}: the PLY header promises {element.count} of element {element.name!r} "
                "without any property"
            )
