"""The read-out as HTML: the status of the arm, and the pose of its tool now and at the goal."""

from __future__ import annotations

import math
from html import escape

from katana450.arm.control.messages import (
    ROOM,
    condition,
    degrees,
    headline,
    limit_text,
    mood,
    sentence,
    signed,
)
from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.resources import STATIC

ROWS = ("x", "y", "z", "roll", "pitch", "yaw")


def page(arm: MountedArm, state: State) -> str:
    """Return the whole read-out for ``state``."""
    chain = arm.chain_to(state.tool)
    now, goal = (_numbers(forward(chain, q)) for q in (state.q, state.goal))
    rows = "".join(
        f"<tr><th>{name}</th><td data-now='{name}'>{a}</td><td data-goal='{name}'>{b}</td>"
        f"<td class='unit'>{'mm' if name in 'xyz' else '°'}</td></tr>"
        for name, a, b in zip(ROWS, now, goal, strict=True)
    )
    why = sentence(state)
    return (
        f"<div class='k450'>"
        f"<p class='status {mood(state)}'><b>{escape(headline(state))}</b>"
        f"<span>{escape(why) or '&nbsp;'}</span></p>"
        f"<table><thead><tr><th>{escape(state.tool)} in {{S}}</th><th>now</th><th>goal</th>"
        f"<th></th></tr></thead><tbody>{rows}</tbody></table>{_at_once(chain, state.q)}</div>"
    )


def _at_once(chain: Chain, q: FloatArray) -> str:
    """Return a table of the distances at ``q`` to a singularity and to the joint limits."""
    values = singular_values(chain, q)
    distances = limit_distances(chain, q)
    nearest = int(distances.argmin())
    rows = (
        ("singular", "smallest singular value", f"{values[-1]:.3f}"),
        ("manipulability", "manipulability", f"{math.prod(values):.3f}"),
        ("condition", "condition", condition(values)),
        ("limit", "nearest limit", limit_text(nearest, float(distances[nearest]))),
    )
    every = "".join(
        f"<td{' class=nearest' if number == nearest else ''}>{degrees(angle, 0)}</td>"
        for number, angle in enumerate(distances.tolist())
    )
    return "<table class='at-once'>{}</table>{}".format(
        "".join(
            f"<tr><th>{escape(name)}</th><td data-now='{key}'>{escape(value)}</td></tr>"
            for key, name, value in rows
        ),
        f"<table class='rooms' data-now='limits'><tr><th>{escape(ROOM)}</th>{every}</tr></table>",
    )


def _numbers(T: FloatArray) -> list[str]:
    position = [signed(1e3 * float(x), 1) for x in T[:3, 3]]
    return position + [signed(math.degrees(angle), 1) for angle in so3.to_rpy(T[:3, :3])]


def style() -> str:
    """Return the style of all HTML in the panel, apart from the read-out, which is sent often."""
    return f"<style>{(STATIC / 'panel.css').read_text(encoding='utf-8')}</style>"
