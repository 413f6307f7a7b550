"""Test that only the command gate puts commands into the pipe to the arm."""

from __future__ import annotations

import ast
from pathlib import Path

import katana450

PACKAGE = Path(katana450.__file__).parent

DELIVERIES = {
    ("server/service/command_gate.py", "self.arm"),
    ("server/service/command_gate.py", "arm"),
    # Behind the gate the handle passes commands on; the worker also adds the planned path.
    ("server/service/arm_handle.py", "self._sink"),
    ("arm/runtime/planning_worker.py", "self._arm"),
    # An offer moves nothing.
    ("arm/runtime/detour_planner.py", "self._arm"),
}
"""Files, and the objects to which they deliver commands."""


def uses(name: str) -> set[tuple[str, str]]:
    """Return each file that uses the attribute ``name``, with the object that has it."""
    texts = {path: path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
    return {
        (path.relative_to(PACKAGE).as_posix(), ast.unparse(node.value))
        for path, text in texts.items()
        if name in text
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Attribute) and node.attr == name
    }


def test_only_the_gate_delivers_commands() -> None:
    assert uses("deliver") == DELIVERIES


def test_only_the_front_end_makes_command_messages() -> None:
    made = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if "CommandMessage(" in path.read_text(encoding="utf-8")
    }
    assert made == {"arm/runtime/front_end.py"}
