"""A script that is written in Python: every step is a method, and it prints as YAML."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from katana450.errors import InputError
from katana450.extensions.programs.attached_files import attached
from katana450.extensions.programs.script import parse
from katana450.extensions.programs.script_files import files_in
from katana450.library.script_values import (
    Number,
    Place,
    Point,
    given,
    object_value,
    place_value,
    plain,
)


class ScriptWriter:
    """A script under construction; see `program`."""

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
        """Raise InputError with all mistakes of the script, by the lines of its YAML.

        Files that it names are those of the present folder.
        """
        parse(attached(str(self), files_in(Path())))

    def save(self, path: str | Path) -> None:
        """Write the script to a file, for ``katana450 run``. Raises InputError for a mistake."""
        self.check()
        Path(path).write_text(str(self), encoding="utf-8")

    def scene(self, scene: str | Sequence[Mapping[str, Any]] | Mapping[str, Any]) -> None:
        """Name the scene that it needs: a file, its objects, or a mapping as in a scene file."""
        self._head["scene"] = plain(scene)

    def include(self, *files: str) -> None:
        """Take poses, values and definitions from files beside the script."""
        self._head["include"] = list(files)

    def pose(
        self,
        name: str,
        at: Point | None = None,
        *,
        joints: Sequence[Number] | None = None,
        pitch: Number | None = None,
        roll: Number | None = None,
        yaw: Number | None = None,
        branch: str | None = None,
    ) -> str:
        """Name a place, by a point or by five joint angles, and return its name."""
        self._poses[name] = place_value(at, joints, pitch, roll, branch, yaw)
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
        self._add("repeat", {"times": times, **given(until=until), "steps": inside})

    @contextmanager
    def when(self, **condition: Any) -> Iterator[None]:
        """Do the steps of the block if a condition holds when it is reached: ``held="cup"``."""
        with self._block() as inside:
            yield
        self._add("if", {**condition, "then": inside})

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

    def home(self) -> None:
        """Move to the ready posture."""
        self._steps.append("home")

    def joints(self, *angles: Number) -> None:
        """Move to five joint angles [deg], round obstacles."""
        self._add("joints", list(angles))

    def nudge(self, axis: int, by: Number) -> None:
        """Turn the joint ``axis``, 1 to 5, by an angle [deg]."""
        self._add("nudge", {"axis": axis, "by": by})

    def move(
        self,
        to: Point | None = None,
        *,
        by: Point | None = None,
        pitch: Number | None = None,
        roll: Number | None = None,
        yaw: Number | None = None,
        branch: str | None = None,
    ) -> None:
        """Move to a pose or a point [mm], or by an offset [mm], on any path round obstacles."""
        if isinstance(to, str) and (by, pitch, roll, yaw, branch) == (None,) * 5:
            self._add("move", to)
        elif by is not None and to is None:
            self._add("move", {"by": by, **given(pitch=pitch, roll=roll, yaw=yaw, branch=branch)})
        elif by is None:
            self._add("move", place_value(to, None, pitch, roll, branch, yaw))
        else:
            raise InputError("A move takes `to` or `by`, not both.")

    def via(self, *places: Place, blend: float | None = None) -> None:
        """Move the joints through places with rounded corners."""
        self._add("via", {"through": list(places), **given(blend=blend)})

    def line(
        self,
        to: Point | None = None,
        *,
        by: Point | None = None,
        pitch: Number | None = None,
        roll: Number | None = None,
        yaw: Number | None = None,
        feed: Number | None = None,
    ) -> None:
        """Move the tool point on a straight line, to a point or by an offset [mm]."""
        self._add("line", given(to=to, by=by, pitch=pitch, roll=roll, yaw=yaw, feed=feed))

    def lines(self, *places: Place, blend: float | None = None, feed: Number | None = None) -> None:
        """Move the tool point on straight lines through places with rounded corners."""
        self._add("lines", {"through": list(places), **given(blend=blend, feed=feed)})

    def arc(
        self,
        centre: Point,
        axis: str | Sequence[float],
        angle: Number,
        *,
        climb: Number | None = None,
        pitch: Number | None = None,
        roll: Number | None = None,
        yaw: Number | None = None,
        feed: Number | None = None,
    ) -> None:
        """Move the tool point round an axis through ``centre`` [mm] by an angle [deg]."""
        value = {"centre": centre, "axis": axis, "angle": angle}
        self._add(
            "arc", {**value, **given(climb=climb, pitch=pitch, roll=roll, yaw=yaw, feed=feed)}
        )

    def circle(  # noqa: PLR0913 - the fields of the step
        self,
        centre: Point,
        normal: str | Sequence[float],
        radius: Number,
        *,
        turns: Number | None = None,
        pitch: Number | None = None,
        roll: Number | None = None,
        yaw: Number | None = None,
        branch: str | None = None,
        feed: Number | None = None,
    ) -> None:
        """Move to the highest point of a circle [mm], then round it."""
        value = {"centre": centre, "normal": normal, "radius": radius}
        more = given(turns=turns, pitch=pitch, roll=roll, yaw=yaw, branch=branch, feed=feed)
        self._add("circle", {**value, **more})

    def screw(
        self,
        point: Point,
        axis: str | Sequence[float],
        *,
        angle: Number | None = None,
        climb: Number | None = None,
    ) -> None:
        """Move the tool as a rigid body about an axis [deg] and along it [mm]."""
        self._add("screw", {"point": point, "axis": axis, **given(angle=angle, climb=climb)})

    def trajectory(
        self, times: Sequence[Number] | str, postures: Sequence[Sequence[Number]] = ()
    ) -> None:
        """Move through joint angles [deg] at times [s], slower where limits require.

        ``times`` may be the name of a .csv file beside the script instead, with both.
        """
        if isinstance(times, str):
            self._add("trajectory", {"file": times})
            return
        rows = zip(times, postures, strict=True)
        self._add("trajectory", {"through": [[time, *angles] for time, angles in rows]})

    def gripper(self, where: Number, *, holding: str | None = None) -> None:
        """Open or close the fingers: "open", "closed", or an angle [deg], [mm] if they slide.

        With ``holding`` they must hold this object then.
        """
        self._add("gripper", where if holding is None else {"to": where, "holding": holding})

    def grip(self, until: Number, *, holding: str | None = None) -> None:
        """Close the fingers until they press with a force [N].

        With ``holding`` they must hold this object then.
        """
        self._add("grip", {"until": until, **given(holding=holding)})

    def wait(self, seconds: Number) -> None:
        """Wait [s]."""
        self._add("wait", seconds)

    def wait_for(self, *, timeout: Number | None = None, **condition: Any) -> None:
        """Wait until a condition holds, such as ``held="cup"``; see docs/programs.md."""
        self._add("wait_for", {**condition, **given(timeout=timeout)})

    def tool(self, name: str) -> None:
        """Use another tool frame for all later points."""
        self._add("tool", name)

    def speed(self, fraction: Number) -> None:
        """Limit all later motions to a fraction of full speed."""
        self._add("speed", fraction)

    def put(self, name: str, x: Number, y: Number) -> None:
        """Set an object to another place on the table [mm], without the arm."""
        self._add("put", {"object": name, "x": x, "y": y})

    def fill(self, ml: Number) -> None:
        """Fill the cup with water [ml]."""
        self._add("fill", ml)

    def grasp(
        self,
        name: str,
        *,
        side: str | None = None,
        pitch: Number | None = None,
        height: Number | None = None,
    ) -> None:
        """Grasp an object where it stands, from the "front" or from "above".

        Side, pitch [deg] and height [mm] are found unless given.
        """
        self._add("grasp", object_value(name, side=side, pitch=pitch, height=height))

    def pick(
        self,
        name: str,
        *,
        side: str | None = None,
        pitch: Number | None = None,
        height: Number | None = None,
    ) -> None:
        """Grasp an object as ``grasp`` does, and lift it."""
        self._add("pick", object_value(name, side=side, pitch=pitch, height=height))

    def place(self, at: Point | None = None, *, on: str | None = None) -> None:
        """Put the held object down, upright, at a place, or on another object.

        The place is x, y and, if wanted, z [mm] of its underside and its yaw [deg].
        """
        self._add("place", given(at=at, on=on))

    def stack(self, name: str, *, on: str) -> None:
        """Pick an object and place it on the middle of another."""
        self._add("stack", {"object": name, "on": on})

    def release(self) -> None:
        """Open the fingers on the held object where it is."""
        self._steps.append("release")

    def pour(
        self,
        into: str,
        *,
        ml: Number | None = None,
        shake: int | None = None,
        rate: Number | None = None,
    ) -> None:
        """Pour the cup in the hand into an object: all of it or some [ml], at a rate [ml/s]."""
        more = given(ml=ml, shake=shake, rate=rate)
        self._add("pour", {"into": into, **more} if more else into)

    def set_down(self) -> None:
        """Put the held object back to where it was grasped."""
        self._steps.append("set_down")

    def call(self, name: str, **parameters: Any) -> None:
        """Do the steps of a definition of an included file, with other values of parameters."""
        self._add("call", {"name": name, "with": parameters} if parameters else name)

    def _add(self, name: str, value: Any) -> None:
        self._steps.append({name: plain(value)})


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
