"""A script that is written in Python: every step is a method, and it prints as YAML."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
import yaml

from katana450.errors import InputError
from katana450.extensions.programs.script.script import parse
from katana450.library.step_methods import StepMethods
from katana450.maths.geometry.arrays import FloatArray

Number = float | str
"""A number in the unit of its place (mm, deg, s, ml), or a text with a unit, such as "4 cm"."""

Point = Sequence[Number] | FloatArray | Mapping[str, Number] | str
"""A point: three numbers, {x, y, z}, or the name of a pose."""


class PlaceOptions(TypedDict, total=False):
    """The orientation of the tool [deg], and the branch of the arm, such as "front-up"."""

    pitch: Number | None
    roll: Number | None
    yaw: Number | None
    branch: str | None


class ScriptWriter(StepMethods):
    """A script under construction, with a method for each step; see `program`."""

    def __init__(self, head: Mapping[str, Any]) -> None:
        """Begin a script with the fields ``head``; None leaves a field out."""
        self._head = {name: value for name, value in head.items() if value is not None}
        self._poses: dict[str, Any] = {}
        self._expected: dict[str, Any] = {}
        self._steps: list[Any] = []

    def __str__(self) -> str:
        """Return the script as YAML."""
        fields = {**self._head}
        if self._poses:
            fields["poses"] = self._poses
        fields["steps"] = self._steps
        if self._expected:
            fields["expect"] = self._expected
        text: str = yaml.safe_dump(
            fields, sort_keys=False, default_flow_style=None, allow_unicode=True, width=100
        )
        return text

    def check(self) -> None:
        """Raise InputError with all mistakes of the script, by the lines of its YAML."""
        parse(str(self))

    def save(self, path: str | Path) -> None:
        """Write the script to a file, for ``katana450 run``. Raises InputError for a mistake."""
        self.check()
        Path(path).write_text(str(self), encoding="utf-8")

    def scene(self, scene: Sequence[Mapping[str, Any]] | Mapping[str, Any]) -> None:
        """Give the scene that it needs: its objects, or a mapping as in a scene file."""
        self._head["scene"] = plain(scene)

    def pose(
        self,
        name: str,
        at: Point | None = None,
        *,
        joints: Sequence[Number] | None = None,
        **how: Unpack[PlaceOptions],
    ) -> str:
        """Name a place, by a point or by five joint angles, and return its name."""
        self._poses[name] = place_value(at, how, joints)
        return name

    def expect(
        self, measure: str, *, at_least: float | None = None, at_most: float | None = None
    ) -> None:
        """Let a simulation end with an error if a measure is beyond its bounds."""
        self._expected[measure] = given(at_least=at_least, at_most=at_most)

    @contextmanager
    def repeat(self, times: int, *, until: Mapping[str, Any] | None = None) -> Iterator[None]:
        """Repeat the steps of the block, which are planned once. A loop of Python does it too.

        ``until``: a condition as of ``when``, such as ``{"held": "cup"}``, which ends it earlier.
        """
        with self._block() as inside:
            yield
        self.write("repeat", given(times=times, until=until, steps=inside))

    @contextmanager
    def when(self, **condition: Any) -> Iterator[None]:
        """Do the steps of the block if a condition holds when it is reached: ``held="cup"``."""
        with self._block() as inside:
            yield
        self.write("if", {**condition, "then": inside})

    @contextmanager
    def otherwise(self) -> Iterator[None]:
        """Do the steps of the block if the condition of the block ``when`` before it fails.

        Raises InputError without such a block.
        """
        last = self._steps[-1] if self._steps else None
        choice = last.get("if") if isinstance(last, dict) else None
        if choice is None or "else" in choice:
            raise InputError("A block `otherwise` must follow a block `when`.")
        with self._block() as inside:
            yield
        choice["else"] = inside

    @contextmanager
    def _block(self) -> Iterator[list[Any]]:
        """Add the steps of the block to a list of their own."""
        outside, self._steps = self._steps, []
        try:
            yield self._steps
        finally:
            self._steps = outside

    def move(self, to: Point, **how: Unpack[PlaceOptions]) -> None:
        """Move to a pose or a point [mm], on any path round obstacles."""
        is_name = isinstance(to, str) and not how
        self.write("move", to if is_name else place_value(to, how))

    def write(self, step: str, content: Any) -> None:
        """Append a step with its content as in a script, {} for none."""
        self._steps.append({step: plain(content)} if content != {} else step)


@contextmanager
def program(
    name: str = "Script",
    *,
    about: str | None = None,
    frame: str | None = None,
    tool: str | None = None,
    speed: Number | None = None,
    gripper: str | None = None,
) -> Iterator[ScriptWriter]:
    """Write a script, which is checked at the end of the ``with`` block and prints as YAML.

    Its units are those of scripts: mm, deg, s and ml. A text may carry a unit.

    Args:
        name: name of the script.
        about: description for people.
        frame: frame of all points: "shoulder", the paper's {S}, or "base", on the table; None for
            "shoulder".
        tool: tool frame of all points; None for the present one.
        speed: fraction of full speed; None for 1.
        gripper: "none" for an arm without its gripper.

    Raises InputError at the end of the block, with all mistakes of the script.

    >>> with katana450.program("Square", frame="base", tool="tcp") as p:
    ...     p.move([320, -60, 150], pitch=50, roll=0)
    ...     for by in ({"y": 120}, {"z": 80}, {"y": -120}, {"z": "-8 cm"}):
    ...         p.line(by=by)
    ...     p.home()
    >>> print(p)
    name: Square
    frame: base
    tool: tcp
    steps:
    - move: {x: 320, y: -60, z: 150, pitch: 50, roll: 0}
    - line:
        by: {y: 120}
    - line:
        by: {z: 80}
    - line:
        by: {y: -120}
    - line:
        by: {z: -8 cm}
    - home
    <BLANKLINE>
    """
    head = {"name": name, "about": about, "gripper": gripper, "frame": frame, "tool": tool}
    script = ScriptWriter({**head, "speed": plain(speed)})
    yield script
    script.check()


def given(**values: Any) -> dict[str, Any]:
    """Return the values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def place_value(
    at: Point | None, how: PlaceOptions, joints: Sequence[Number] | None = None
) -> dict[str, Any]:
    """Return a place as a mapping. Raises InputError for a point that is none."""
    angles = given(**how)
    if joints is not None:
        return {"joints": plain(list(joints)), **angles}
    point = plain(at)
    if isinstance(point, list) and len(point) == 3:
        point = dict(zip("xyz", point, strict=True))
    if not isinstance(point, dict):
        raise InputError(f"A place needs three numbers x, y and z, not {at!r}.")
    return {**point, **angles}


def plain(value: Any) -> Any:
    """Return ``value`` as YAML writes it; numbers of numpy become those of Python."""
    match value:
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case Mapping():
            return {str(name): plain(entry) for name, entry in value.items()}
        case list() | tuple():
            return [plain(entry) for entry in value]
        case float() if not math.isfinite(value):
            raise InputError(f"A number of a script must be finite, not {value}.")
    return value
