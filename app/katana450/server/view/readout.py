"""The read-out as HTML: the pose of the tool now and at the goal, and the distances to limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from katana450.arm.control.messages import ROOM, axis_names, condition, degrees, limit_text, signed
from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.resources import STATIC

ROWS = ("x", "y", "z", "roll", "pitch", "yaw")


BASE, SHOULDER = "Base", "Shoulder {S}"
"""Frames of the numbers."""


def page(arm: MountedArm, state: State, display: PoseDisplay) -> str:
    """Return the tool pose now and at the goal as ``display`` says, and the nearest limit now."""
    chain = arm.chain_to(state.tool)
    now, goal = (_numbers(forward(chain, q), display) for q in (state.q, state.goal))
    rows = "".join(
        f"<tr><th>{name}</th><td data-now='{name}'>{a}</td><td data-goal='{name}'>{b}</td>"
        f"<td class='unit'>{(display.length if name in 'xyz' else display.angle).name}</td></tr>"
        for name, a, b in zip(ROWS, now, goal, strict=True)
    )
    distances = limit_distances(chain, state.q)
    nearest = int(distances.argmin())
    limit = limit_text(nearest, axis_names(chain.names)[nearest], float(distances[nearest]))
    return (
        f"<div class='k450'><table><thead><tr><th>{escape(state.tool)} in {display.frame_name}</th>"
        f"<th>now</th><th>goal</th><th></th></tr></thead><tbody>{rows}</tbody></table>"
        f"<table class='at-once'>{_row('limit', 'nearest limit', limit)}</table></div>"
    )


def details(arm: MountedArm, state: State) -> str:
    """Return the distances of the arm to a singularity and to every joint limit."""
    chain = arm.chain_to(state.tool)
    values = singular_values(chain, state.q)
    distances = limit_distances(chain, state.q)
    nearest = int(distances.argmin())
    rows = (
        ("singular", "smallest singular value", f"{values[-1]:.3f}"),
        ("manipulability", "manipulability", f"{math.prod(values):.3f}"),
        ("condition", "condition", condition(values)),
    )
    every = "".join(
        f"<td{' class=nearest' if number == nearest else ''}>{degrees(angle, 0)}</td>"
        for number, angle in enumerate(distances.tolist())
    )
    return (
        f"<div class='k450'><table>{''.join(_row(*row) for row in rows)}</table>"
        f"<table class='rooms' data-now='limits'><tr><th>{escape(ROOM)}</th>{every}</tr></table>"
        f"</div>"
    )


def _row(key: str, name: str, value: str) -> str:
    return f"<tr><th>{escape(name)}</th><td data-now='{key}'>{escape(value)}</td></tr>"


def _numbers(T: FloatArray, display: PoseDisplay) -> list[str]:
    position, angles = display.numbers(T)
    decimals = [display.length.decimals] * 3 + [display.angle.decimals] * 3
    return [signed(x, n) for x, n in zip((*position, *angles), decimals, strict=True)]


def style() -> str:
    """Return the style of all HTML in the panel, apart from the read-out, which is sent often."""
    return f"<style>{(STATIC / 'panel.css').read_text(encoding='utf-8')}</style>"


class DisplayUnit(NamedTuple):
    """A unit of length or angle.

    Attributes:
        name: its symbol.
        per_si: number of units in a metre or a radian.
        decimals: number of decimals that are shown.
        step: step of a number box, in this unit.
    """

    name: str
    per_si: float
    decimals: int
    step: float


LENGTHS = (
    DisplayUnit("mm", 1e3, 1, 1.0),
    DisplayUnit("cm", 1e2, 2, 0.1),
    DisplayUnit("in", 1.0 / 0.0254, 3, 0.05),
)
ANGLES = (DisplayUnit("°", math.degrees(1.0), 1, 1.0), DisplayUnit("rad", 1.0, 3, 0.01))

UNITS = {f"{length.name}, {angle.name}": (length, angle) for angle in ANGLES for length in LENGTHS}
"""Units of length and angle, by the name of their choice."""


class PoseDisplay(NamedTuple):
    """Conversion between poses in {S} and the numbers of the panel.

    Attributes:
        length: unit of the position.
        angle: unit of roll, pitch and yaw.
        frame: BASE or SHOULDER.
        T_base_shoulder: (4, 4) the frame {S} in the base frame [m].
    """

    length: DisplayUnit
    angle: DisplayUnit
    frame: str
    T_base_shoulder: FloatArray

    @property
    def frame_name(self) -> str:
        """The short name of the frame."""
        return "base" if self.frame == BASE else "{S}"

    def numbers(self, T: FloatArray) -> tuple[list[float], list[float]]:
        """Return position [length] and roll, pitch, yaw [angle] of ``T`` (4, 4) in {S}."""
        shown = self.T_base_shoulder @ T if self.frame == BASE else T
        position = self.length.per_si * shown[:3, 3]
        angles = [self.angle.per_si * angle for angle in so3.to_rpy(shown[:3, :3])]
        return position.tolist(), angles

    def pose(self, position: Sequence[float], angles: Sequence[float]) -> FloatArray:
        """Return the pose (4, 4) in {S} of a position [length] and roll, pitch, yaw [angle]."""
        R = so3.from_rpy(*(angle / self.angle.per_si for angle in angles))
        T = se3.from_rotation_translation(R, np.array(position) / self.length.per_si)
        return se3.inverse(self.T_base_shoulder) @ T if self.frame == BASE else T
