"""Message about a path that the tool cannot follow: how far out of reach it is, and what works."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from katana450.errors import BlockedError, InputError, PathError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.planning.curve_path import LostPathError
from katana450.extensions.programs.planning.curves import Curve, line_between
from katana450.extensions.programs.planning.out_of_reach import farthest, near_points
from katana450.maths.geometry.arrays import frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.checkpoint import checkpoint

ANGLE = "angle"
"""Name of the field with the size of an arc that is no circle."""

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
    plan: PlanState,
    refused: InputError,
    curve: Curve,
    branch: AnyBranch,
    remedies: Iterator[str],
) -> InputError:
    """Return ``refused`` with the amount by which the path is out of reach, and what works.

    A refusal for a contact, or for another reason than the path, is returned unchanged.

    Args:
        plan: the arm at the start of the path.
        refused: why it cannot follow the path.
        curve: the path of the tool.
        branch: the branch of the joints on the path.
        remedies: texts to copy, each of which makes the path possible.
    """
    frame = plan.frame
    if frame is None or isinstance(refused, BlockedError) or not isinstance(refused, PathError):
        return refused
    if plan.given_up:
        # With another grasp. Only the refusal with the first one is shown.
        return refused
    text = refused.text + farthest(plan.planning, plan.q, curve, branch, frame)
    if works := list(remedies):
        text += f" It can be followed {' or '.join(works)}."
    return PathError(text, refused.point, parts=refused.parts)


def line_remedies(
    plan: PlanState, start: ToolTarget, end: ToolTarget, refused: InputError
) -> Iterator[str]:
    """Yield texts to copy, with each of which the line from ``start`` to ``end`` is possible.

    ``refused``: why the whole line is not.
    """

    def possible(target: ToolTarget) -> bool:
        return _possible(lambda: plan.lead([line_between(start, target)], "line"))

    for pitch in _other_pitch(end, possible):
        yield f"with `pitch: {pitch:g}` at its end"
    length = math.dist(start.position, end.position)
    if length <= MIN_LENGTH or plan.frame is None:
        return
    if isinstance(refused, LostPathError):
        reached = refused.sigma
    else:
        reached = _farthest(
            lambda fraction: possible(end.moved(start.towards(end, fraction).position))
        )
    if reached * length > MIN_LENGTH + LEFT:
        last = start.towards(end, reached - LEFT / length).position
        for text, p in near_points(plan.frame, last):
            if possible(end.moved(frozen(p))):
                yield f"as far as `to: {text}`"
                return


def arc_remedies(
    end: ToolTarget,
    build: Callable[[ToolTarget, float], PlanState],
    size: tuple[str, float],
    refused: InputError,
) -> Iterator[str]:
    """Yield texts to copy, with each of which an arc is possible.

    Args:
        end: the target at the end of the arc, whose orientation counts.
        build: returns the plan with the arc to another orientation, and with a fraction of its
            size. Raises InputError.
        size: name and value of the field that gives its size, in the unit of a script.
        refused: why the whole arc is not possible.
    """

    def possible(target: ToolTarget, fraction: float) -> bool:
        return _possible(lambda: build(target, fraction))

    for other in _other_pitch(end, lambda target: possible(target, 1.0)):
        yield f"with `pitch: {other:g}`"
    name, value = size
    if name == ANGLE and isinstance(refused, LostPathError):
        reached = refused.sigma
    else:
        reached = _farthest(lambda fraction: possible(end, fraction))
    shorter = math.trunc(reached * value)
    if shorter and possible(end, shorter / value):
        yield f"with `{name}: {shorter}`"


def _farthest(possible: Callable[[float], bool]) -> float:
    """Return the largest fraction below 1 that is ``possible``, approximately; 0 if none is."""
    reached, beyond = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (reached + beyond)
        reached, beyond = (middle, beyond) if possible(middle) else (reached, middle)
    return reached


def _other_pitch(end: ToolTarget, possible: Callable[[ToolTarget], bool]) -> Iterator[float]:
    """Yield the pitch [deg] nearest to that of ``end`` that is ``possible``, if there is one.

    Only targets of five axes have a pitch that can be changed alone.
    """
    if not end.is_pitched:
        return
    present = math.degrees(end.pitch)
    pitches = np.arange(-MAX_PITCH, MAX_PITCH + PITCH_STEP, PITCH_STEP).tolist()
    for pitch in sorted(pitches, key=lambda angle: abs(angle - present)):
        if possible(replace(end, pitch=math.radians(pitch))):
            yield pitch
            return


def _possible(build: Callable[[], PlanState]) -> bool:
    """Return whether ``build`` succeeds."""
    checkpoint()
    try:
        build()
    except InputError:
        return False
    return True
