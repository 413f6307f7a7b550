"""Every file of the app is in one of twelve rooms, and no room grows. See docs/decisions/0115."""

from __future__ import annotations

import re
from pathlib import Path

import katana450

PACKAGE = Path(katana450.__file__).parent
ROOT = Path(__file__).resolve().parents[2]
TABLE = (ROOT / "docs" / "decisions" / "0115-the-app-has-twelve-rooms.md").read_text("utf-8")
ROW = re.compile(r"^\| `(\w+)` \| ([\d,]+) \| [\d,]+ \| (.*) \|$", re.MULTILINE)


def rooms() -> dict[str, tuple[int, list[str]]]:
    """Return the maximum number of lines and the places of each room, as the decision lists them.

    A place is a folder below the package, or a file of it.
    """
    rows = {name: (most, places) for name, most, places in ROW.findall(TABLE)}
    return {
        name: (int(most.replace(",", "")), re.findall(r"`([\w/.]+)`", places))
        for name, (most, places) in rows.items()
    }


def files_in(place: str) -> set[Path]:
    if place == "static":
        # The library for plots is not ours.
        return {file for file in (ROOT / "static").rglob("*.js") if file.parent.name != "uplot"}
    path = PACKAGE / place
    assert path.exists(), f"There is no {place}."
    return {path} if path.is_file() else set(path.rglob("*.py"))


def test_rooms_do_not_grow() -> None:
    sizes = {}
    for name, (most, places) in rooms().items():
        files = set().union(*map(files_in, places))
        lines = sum(len(file.read_text("utf-8").splitlines()) for file in files)
        if not 0.9 * most <= lines <= most:
            sizes[name] = f"{lines} lines, where 90 to 100 % of {most} are allowed"
    assert len(rooms()) == 12
    assert not sizes


def test_every_file_is_in_one_room() -> None:
    counts = dict.fromkeys(PACKAGE.rglob("*.py"), 0)
    for name, (_, places) in rooms().items():
        for file in set().union(*map(files_in, places)) if name != "page" else ():
            counts[file] += 1
    wrong = [str(file.relative_to(PACKAGE)) for file, count in counts.items() if count != 1]
    assert not wrong, "These files are in no room, or in several:\n" + "\n".join(wrong)


PLACES = (
    "extensions/programs",
    "arm/control",
    "arm/runtime",
    "extensions/importers",
    "extensions/export",
)
"""Folders of the rooms of programs, control and files."""


def test_folders_of_programs_control_and_files_are_small() -> None:
    folders = [
        path
        for place in PLACES
        for path in (PACKAGE / place, *(PACKAGE / place).rglob("*"))
        if path.is_dir() and path.name != "__pycache__"
    ]
    sizes = {str(path.relative_to(PACKAGE)): len(list(path.glob("[!_]*"))) for path in folders}
    assert len(sizes) > 20
    assert {name: size for name, size in sizes.items() if size > 14} == {}
