"""The read-out as HTML: the pose of the tool now and at the goal, and the distances to limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from katana450.arm.control.arm import JointSet
from katana450.arm.control.state.messages import axis_names, limit_text, part, signed
from katana450.arm.control.state.state import State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import limit_distances, nearest_limit
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
        f"<td class='unit'>{'mm' if name in 'xyz' else '°'}</td></tr>"
        for name, a, b in zip(ROWS, now, goal, strict=True)
    )
    distances = limit_distances(chain, state.q)
    nearest = nearest_limit(chain, distances)
    limit = limit_text(nearest, axis_names(chain.names)[nearest], float(distances[nearest]))
    return (
        "<div class='k450'><table class='pose'><thead><tr>"
        f"<th>{escape(part(state.tool))} in {display.frame_name}</th>"
        f"<th>now</th><th>goal</th><th></th></tr></thead><tbody>{rows}</tbody></table>"
        "<table class='at-once'><tr><th>nearest limit</th>"
        f"<td data-now='limit'>{escape(limit)}</td></tr></table></div>"
    )


def joint_page(joints: JointSet, labels: Sequence[str], state: State) -> str:
    """Return the joint values of a robot without an arm, now and at the goal."""
    rows = "".join(
        f"<tr><th>{escape(label)}</th>"
        f"<td data-now='{axis}'>{signed(factor * float(state.q[axis]), 1)}</td>"
        f"<td data-goal='{axis}'>{signed(factor * float(state.goal[axis]), 1)}</td>"
        f"<td class='unit'>{'mm' if joints.slides[axis] else '°'}</td></tr>"
        for axis, (label, factor) in enumerate(zip(labels, per_si(joints.slides), strict=True))
    )
    return (
        f"<div class='k450'><table><thead><tr><th>joint</th><th>now</th><th>goal</th><th></th></tr>"
        f"</thead><tbody>{rows}</tbody></table></div>"
    )


def per_si(slides: Sequence[bool]) -> tuple[float, ...]:
    """Return the number of the panel's units [mm, deg] in an SI unit [m, rad], for each joint."""
    return tuple(1e3 if slide else math.degrees(1.0) for slide in slides)


def _numbers(T: FloatArray, display: PoseDisplay) -> list[str]:
    position, angles = display.numbers(T)
    return [signed(number, 1) for number in (*position, *angles)]


def style() -> str:
    """Return the style of all HTML in the panel, apart from the read-out, which is sent often."""
    return f"<style>{(STATIC / 'panel.css').read_text(encoding='utf-8')}</style>"


class PoseDisplay(NamedTuple):
    """Conversion between poses in {S} and the numbers of the panel, in mm and degrees.

    Attributes:
        frame: BASE or SHOULDER.
        T_base_shoulder: (4, 4) the frame {S} in the base frame [m].
        R_roll_tool: (3, 3) the tool in a frame whose x axis is the roll axis of five axes: its
            pitch is that of the instruments.
    """

    frame: str
    T_base_shoulder: FloatArray
    R_roll_tool: FloatArray = frozen(np.eye(3))

    @property
    def frame_name(self) -> str:
        """The short name of the frame."""
        return "base" if self.frame == BASE else "{S}"

    def numbers(self, T: FloatArray) -> tuple[list[float], list[float]]:
        """Return position [mm] and roll, pitch, yaw [deg] of ``T`` (4, 4) in {S}."""
        shown = self.T_base_shoulder @ T if self.frame == BASE else T
        angles = so3.to_rpy(shown[:3, :3] @ self.R_roll_tool.T)
        return (1e3 * shown[:3, 3]).tolist(), [*map(math.degrees, angles)]

    def pose(self, position: Sequence[float], angles: Sequence[float]) -> FloatArray:
        """Return the pose (4, 4) in {S} of a position [mm] and roll, pitch, yaw [deg]."""
        R = so3.from_rpy(*map(math.radians, angles)) @ self.R_roll_tool
        T = se3.from_rotation_translation(R, 1e-3 * np.array(position))
        return se3.inverse(self.T_base_shoulder) @ T if self.frame == BASE else T
