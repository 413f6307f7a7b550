"""Message about a path that the tool cannot follow: how far out of reach it is, and what works."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from katana450.errors import BlockedError, InputError, PathError
from katana450.extensions.programs.curve import Curve, ToolLine
from katana450.extensions.programs.out_of_reach import (
    NearestPlace,
    binding,
    millimetres,
    near_points,
    nearest_place,
)
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.reaching import EXACT
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.jet import Jet

SAMPLES = 65
"""Number of places of a path that are compared."""

HALVINGS = 12
"""Number of halvings that find how far a path can go."""

MIN_LENGTH = 1e-3
"""[m] Length below which a shorter line is not suggested."""

PITCH_STEP = 5.0
"""[deg] Distance of the pitches that are tried."""

MAX_PITCH = 90.0
"""[deg] Maximum pitch that is suggested, up or down."""

LEFT = 1e-4
"""[m] Length by which a suggested line ends before the last place that it can reach."""


def unfollowed(
    builder: PlanBuilder,
    refused: InputError,
    curve: Curve,
    branch: Branch,
    remedies: Iterator[str],
) -> InputError:
    """Return ``refused`` with the amount by which the path is out of reach, and what works.

    A refusal for a contact, or for another reason than the path, is returned unchanged.

    Args:
        builder: the arm at the start of the path.
        refused: why it cannot follow the path.
        curve: the path of the tool.
        branch: the branch of the joints on the path.
        remedies: texts to copy, each of which makes the path possible.
    """
    frame = builder.frame
    if frame is None or isinstance(refused, BlockedError) or not isinstance(refused, PathError):
        return refused
    if builder.given_up:
        # With another grasp. Only the refusal with the first one is shown.
        return refused
    text = refused.text
    sigma, target, nearest = _worst(builder, curve, branch)
    missed = nearest.projection.position_error
    if missed > EXACT:
        text += (
            f" Farthest out of reach is {frame.words(target.position)}, {100.0 * sigma:.0f} % "
            f"along it: {millimetres(missed)}, because {binding(builder.chain, nearest)}."
        )
    if works := list(remedies):
        text += f" It can be followed {' or '.join(works)}."
    return PathError(text, refused.point, parts=refused.parts)


def line_remedies(builder: PlanBuilder, start: ToolTarget, end: ToolTarget) -> Iterator[str]:
    """Yield texts to copy, with each of which the line from ``start`` to ``end`` is possible."""

    def possible(tried: ToolTarget) -> bool:
        return _possible(builder, lambda: builder.lead([ToolLine(start, tried)], "line"))

    for pitch in _other_pitch(end.pitch, lambda angle: possible(replace(end, pitch=angle))):
        yield f"with `pitch: {pitch:g}` at its end"
    length = math.dist(start.position, end.position)
    if length <= MIN_LENGTH or builder.frame is None:
        return
    reached = _farthest(lambda fraction: possible(_shortened(start, end, fraction)))
    if reached * length > MIN_LENGTH + LEFT:
        last = _shortened(start, end, reached - LEFT / length)
        for text, p in near_points(builder.frame, last.position):
            if possible(replace(end, position=p)):
                yield f"as far as `to: {text}`"
                return


def arc_remedies(
    builder: PlanBuilder,
    pitch: float,
    build: Callable[[float, float], None],
    size: tuple[str, float],
) -> Iterator[str]:
    """Yield texts to copy, with each of which an arc is possible.

    Args:
        builder: the arm at the start.
        pitch: the pitch of the arc [rad].
        build: appends the arc with another pitch [rad], and a fraction of its size, to ``builder``.
            Raises InputError.
        size: name and value of the field that gives its size, in the unit of a script.
    """

    def possible(angle: float, fraction: float) -> bool:
        return _possible(builder, lambda: build(angle, fraction))

    for other in _other_pitch(pitch, lambda angle: possible(angle, 1.0)):
        yield f"with `pitch: {other:g}`"
    name, value = size
    shorter = math.trunc(_farthest(lambda fraction: possible(pitch, fraction)) * value)
    if shorter and possible(pitch, shorter / value):
        yield f"with `{name}: {shorter}`"


def _farthest(possible: Callable[[float], bool]) -> float:
    """Return the largest fraction below 1 that is ``possible``, approximately; 0 if none is."""
    reached, beyond = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (reached + beyond)
        reached, beyond = (middle, beyond) if possible(middle) else (reached, middle)
    return reached


def _shortened(start: ToolTarget, end: ToolTarget, fraction: float) -> ToolTarget:
    """Return the end of a part of the line, with pitch and roll of the whole line's end."""
    return replace(end, position=start.towards(end, fraction).position)


def _other_pitch(pitch: float, possible: Callable[[float], bool]) -> Iterator[float]:
    """Yield the possible pitch [deg] that is nearest to ``pitch`` [rad], if there is one."""
    here = math.degrees(pitch)
    tried = np.arange(-MAX_PITCH, MAX_PITCH + PITCH_STEP, PITCH_STEP).tolist()
    for each in sorted(tried, key=lambda angle: abs(angle - here)):
        if possible(math.radians(each)):
            yield each
            return


def _possible(builder: PlanBuilder, build: Callable[[], None]) -> bool:
    """Return whether ``build`` succeeds; undo it."""
    checkpoint()
    state, actions = builder.state, list(builder.actions)
    try:
        build()
    except InputError:
        return False
    finally:
        builder.state, builder.actions = state, actions
    return True


def _worst(
    builder: PlanBuilder, curve: Curve, branch: Branch
) -> tuple[float, ToolTarget, NearestPlace]:
    """Return the place of ``curve`` that is farthest out of reach: sigma, target, nearest place."""
    found = []
    for sigma in np.linspace(0.0, 1.0, SAMPLES).tolist():
        checkpoint()
        tool = curve.at(Jet.variable(sigma))
        x, y, z, pitch, roll = (float(np.asarray(each.c0)) for each in tool)
        target = ToolTarget(np.array((x, y, z)), pitch, roll)
        nearest = nearest_place(builder.chain, builder.q, target, branch, Priority.PITCH)
        found.append((sigma, target, nearest))
    return max(found, key=lambda each: each[2].projection.position_error)
