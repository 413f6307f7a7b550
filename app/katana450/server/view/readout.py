"""The read-out as HTML: the pose of the tool now and at the goal, and the distances to limits."""

from __future__ import annotations

import math
from html import escape

from katana450.arm.control.messages import ROOM, axis_names, condition, degrees, limit_text, signed
from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.resources import STATIC
from katana450.server.view.pose_display import PoseDisplay

ROWS = ("x", "y", "z", "roll", "pitch", "yaw")


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
