"""The rooms stand on each other as CONTRIBUTING says: imports run one way."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "hmrf_icp"
CONTRIBUTING = ROOT / "CONTRIBUTING.md"

pytestmark = pytest.mark.skipif(
    not CONTRIBUTING.exists(), reason="tests run without the repository"
)

FLOORS = (
    ("errors", "frozen", "kernels", "lazy", "stages"),
    ("se3", "threads"),
    ("clouds",),
    ("io", "synthetic", "drawing"),
    ("loop",),
    ("field",),
    ("search",),
    ("presets",),
    ("result",),
    ("registration",),
    ("figures", "datasets"),
    ("evaluate", "plot"),
    ("view",),
    ("cli",),
)
"""From the ground up; a room imports from its own floor only within itself, and from below."""

DOORS = {("result", "view")}
"""Imports that run upwards, when they are called: ``result.show()`` opens the viewer."""

FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}


def room_of(path: Path) -> str:
    """The room a file stands in: its folder, or itself on the top floor."""
    inside = path.relative_to(PACKAGE).parts
    return inside[0] if len(inside) > 1 else path.stem


def imported_rooms(path: Path) -> set[str]:
    """Rooms of the package that a file imports from, wherever in the file."""
    rooms = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "hmrf_icp":
            # What the package shows on its front is made in the room that registers.
            names = {alias.name for alias in node.names}
            rooms |= {name if name in FLOOR else "registration" for name in names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hmrf_icp."):
            rooms.add(node.module.split(".")[1])
        elif isinstance(node, ast.Import):
            rooms |= {a.name.split(".")[1] for a in node.names if a.name.startswith("hmrf_icp.")}
    return rooms


FILES = [
    path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.name not in ("__init__.py", "__main__.py") or path.parent != PACKAGE
]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_room_imports_only_from_the_floors_below(path):
    room = room_of(path)
    assert room in FLOOR, f"{room} is on no floor of this test"
    for other in imported_rooms(path) - {room}:
        if (room, other) in DOORS:
            continue
        assert other in FLOOR, f"{path}: imports {other}, which is no room"
        assert FLOOR[other] < FLOOR[room], f"{path}: {room} imports {other}, which stands above it"


def test_contributing_shows_the_rooms_that_there_are():
    rooms = {room_of(path) for path in FILES}
    drawn = CONTRIBUTING.read_text(encoding="utf-8")
    missing = {room for room in rooms if not re.search(rf"\b{room}\b", drawn)}
    assert not missing


def test_no_file_is_longer_than_a_person_reads_in_one_sitting():
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    assert not {path: n for path, n in lines.items() if n > 420}
