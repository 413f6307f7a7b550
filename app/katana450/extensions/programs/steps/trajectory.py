"""The step ``trajectory``: postures at given times, as a recording or another program has them.

Its path is a natural cubic spline through the postures, which keeps their times within the limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np

from katana450.arm.control.session.session import TOOL_SPEED
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import (
    CARRY,
    PlanState,
    UntimedPath,
    require_turning,
)
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.declaration import Kind
from katana450.extensions.programs.language.kinds import (
    LEAST_JOINTS,
    MAX_ANGLE,
    MAX_JOINTS,
    defined,
    degrees,
    list_of,
    listed,
    number,
)
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import YamlValue
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.joint_path import VIA_TOLERANCE, PolynomialPath
from katana450.maths.planning.pacing import KNOTS, SampledPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.plan import check_clear
from katana450.maths.planning.plan import plan as timed_plan
from katana450.maths.planning.polyline import PiecewisePolynomial
from katana450.maths.planning.scaling import Bounds, Scaling

MIN_INTERVAL = 1e-3
"""[s] Minimum time from one posture to the next."""

MAX_OVERSHOOT = 1e-3
"""[rad] How far the spline may pass a joint limit between two postures; setpoints are clamped."""

SLOWED_RATIO, SLOWED_TIME = 0.02, 0.02
"""Minimum time by which a plan exceeds the times of a trajectory that is named, as a ratio [1] to
them and in s."""

CHECKS_PER_PIECE = 8
"""Number of places in each piece at which the limits are checked."""


class CubicSpline(PiecewisePolynomial):
    """The natural cubic spline through the rows of ``values`` (m, n) at ``times`` (m,) [s].

    Value, rate and second derivative are continuous, and the second derivative is 0 at both ends
    (de Boor, A Practical Guide to Splines, 1978, ch. IV).
    """

    def __init__(self, times: FloatArray, values: FloatArray) -> None:
        """Fit the spline through at least two rows; ``times`` must rise."""
        h = np.diff(times)[:, None]
        slopes = np.diff(values, axis=0) / h
        bends = _second_derivatives(h, slopes)
        terms = np.zeros((len(h), 6, values.shape[1]))
        terms[:, 0] = values[:-1]
        terms[:, 1] = slopes - h * (2.0 * bends[:-1] + bends[1:]) / 6.0
        terms[:, 2] = 0.5 * bends[:-1]
        terms[:, 3] = (bends[1:] - bends[:-1]) / (6.0 * h)
        passed = times - times[0]
        super().__init__(passed[:-1].tolist(), frozen(terms), float(passed[-1]))

    def values_at(self, times: FloatArray) -> FloatArray:
        """Return the values (N, n) at ``times`` (N,) [s] after the first one."""
        coordinates = self.at(Jet.variable(np.asarray(times) / self._total))
        return np.stack(
            [np.broadcast_to(coordinate.c0, times.shape) for coordinate in coordinates], axis=1
        )


def _second_derivatives(h: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return the second derivatives (m, n) at the knots.

    The tridiagonal system is eliminated row by row, so that every machine rounds in the same order.
    """
    bends = np.zeros((len(h) + 1, slopes.shape[1]))
    diagonal = 2.0 * (h[:-1, 0] + h[1:, 0])
    right = 6.0 * np.diff(slopes, axis=0)
    for row in range(1, len(diagonal)):
        factor = h[row, 0] / diagonal[row - 1]
        diagonal[row] -= factor * h[row, 0]
        right[row] -= factor * right[row - 1]
    for row in range(len(diagonal) - 1, -1, -1):
        bends[row + 1] = (right[row] - h[row + 1, 0] * bends[row + 2]) / diagonal[row]
    return bends


@dataclass(frozen=True, eq=False)
class TrajectoryPath(PolynomialPath):
    """A joint path through postures at given times, as recorded.

    Its sigma grows evenly with the time. Raises InputError for times that do not rise, and for a
    posture beyond the joint limits.

    Attributes:
        chain: the arm with its tool.
        times: (m,) [s], rising.
        postures: (m, n) joint angles at these times [rad].
    """

    chain: Chain
    times: FloatArray
    postures: FloatArray
    _line: CubicSpline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        times = finite_array(self.times, (np.size(self.times),), "The times")
        shape = (len(times), self.chain.n)
        postures = finite_array(self.postures, shape, "The postures")
        if len(times) < 2:
            raise InputError("A trajectory needs at least two postures.")
        late = np.flatnonzero(np.diff(times) < MIN_INTERVAL)
        if late.size:
            row = int(late[0])
            raise InputError(
                f"Row {row + 2} has the time {times[row + 1]:g} s. It must be at least "
                f"{1e3 * MIN_INTERVAL:g} ms later than that of the row before, {times[row]:g} s."
            )
        if float(np.ptp(postures, axis=0).max()) <= VIA_TOLERANCE:
            raise InputError("This trajectory moves nothing. Remove it, or `wait` instead.")
        line = CubicSpline(times, postures)
        object.__setattr__(self, "times", frozen(times))
        object.__setattr__(self, "_line", line)
        self._check_limits()
        # Angles with few decimals can be beyond a limit by their rounding.
        inside = np.clip(postures, self.chain.lower, self.chain.upper)
        object.__setattr__(self, "postures", frozen(inside))

    def _check_limits(self) -> None:
        inner = np.linspace(0.0, 1.0, CHECKS_PER_PIECE, endpoint=False)
        passed = self.times - self.times[0]
        t = np.append((passed[:-1, None] + np.diff(passed)[:, None] * inner).ravel(), passed[-1])
        q = self._line.values_at(t)
        beyond = np.maximum(self.chain.lower - q, q - self.chain.upper)
        if float(beyond.max()) > MAX_OVERSHOOT:
            place, axis = np.unravel_index(int(beyond.argmax()), beyond.shape)
            raise InputError(
                f"At {self.times[0] + t[place]:.2f} s axis {axis + 1} would be "
                f"{np.degrees(beyond.max()):.4g} deg beyond its limit."
            )

    def slowing(self, duration: float) -> str:
        """Return a sentence on a plan that takes ``duration`` [s]; "" if that is its own time."""
        if duration - self.duration <= max(SLOWED_RATIO * self.duration, SLOWED_TIME):
            return ""
        return (
            f"Asked to take {self.duration:.4g} s, it takes {duration:.2f} s, because the speeds "
            "and accelerations of the joints are limited."
        )

    @property
    def duration(self) -> float:
        """The time from the first posture to the last [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        return frozen(self.postures[0])

    @property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        return frozen(self.postures[-1])

    def moment(self, sigma: float) -> str:
        """Return the place ``sigma`` in words: its time on the clock of ``times``."""
        return f"at {self.times[0] + sigma * self.duration:.2f} s of the trajectory"


PIECE_TIME: Final = 0.1
"""[s] Time of each piece of the slowness."""

MAX_PIECES: Final = 1200
"""Maximum number of pieces, for a trajectory of two minutes and more."""

ROUNDS: Final = 40
"""Number of rounds that make a trajectory slower where it is too fast, and faster where it was made
too slow."""

FACTORS: Final = (4.0, 2.0, 1.4, 1.0, 0.7, 0.5)
"""Fractions [1] of the joints' largest a and j that are tried. Large ones start and pause quickly,
small ones leave more of the joints' acceleration to the trajectory."""


def recorded_scaling(path: Path, bounds: Bounds) -> Scaling:
    """Return the scaling with the times of the trajectory ``path``, or slower within ``bounds``.

    The slowness is nowhere below that of the trajectory. Where a limit would be exceeded it is
    raised, for each of several limits a and j of tau(t); the scaling with the shortest duration is
    returned.
    """
    assert isinstance(path, TrajectoryPath)
    pieces = min(max(math.ceil(path.duration / PIECE_TIME), KNOTS), MAX_PIECES)
    sampled = SampledPath.of(path, bounds, pieces)
    own = np.full(pieces + 3, path.duration)
    joints = bounds.joints
    a = float((joints.acceleration / joints.speed).min())
    j = float((joints.jerk / joints.speed).min())
    fits = (sampled.fitted(factor * a, factor * j, own, ROUNDS, floor=own) for factor in FACTORS)
    best = min(fits, key=lambda fit: fit.time)
    return Scaling(best.coefficients, best.acceleration, best.jerk)


CLEARANCE = MIN_CLEARANCE - 2e-4
"""[m] Distance that a trajectory keeps. A moving arm keeps MIN_CLEARANCE by itself, and the spline
through its recorded setpoints may pass a little nearer."""

MAX_POSTURES = 1200
"""Maximum number of postures of one step; the script's own size bounds their sum."""

MAX_TIME = 24 * 3600.0
"""[s] Maximum time of a posture."""

TRAJECTORY = "trajectory"


@dataclass(frozen=True, eq=False)
class UntimedTrajectory(UntimedPath):
    """A trajectory that is checked for contacts; it gets its own times, or slower ones."""

    def timed(self) -> FollowPlan:
        """Return the timed plan, with limited tool acceleration if an object is held."""
        gentle = None if self.state.grip is None else CARRY
        bounds = Bounds(self.arm.limits, TOOL_SPEED, gentle)
        fingers = self.state.gripper_setpoint
        timed = timed_plan(
            self.paths, bounds, self.world, fingers, CLEARANCE, timing=recorded_scaling
        )
        (path,) = self.paths
        assert isinstance(path, TrajectoryPath)
        note = path.slowing(timed.duration)
        return FollowPlan(timed, note=note)


TIME = number(0.0, MAX_TIME, "s")
JOINT = degrees(-MAX_ANGLE, MAX_ANGLE)


def _row(value: YamlValue, _context: ScriptContext) -> tuple[float, ...]:
    """Read a time [s] and the angles of all joints [deg]; the angles are returned in rad."""
    if value.kind != "list" or not LEAST_JOINTS <= len(value.items) - 1 <= MAX_JOINTS:
        raise value.wrong(
            "Expected a time and the angles of all joints, such as [0.5, 0, -65, 85, 8, 0]."
        )
    time, *angles = value.items
    return TIME(time), *map(JOINT, angles)


POSTURE = defined(
    "posture",
    Kind(
        _row,
        list_of(
            number(-MAX_TIME, MAX_TIME, about="A time, s, then the angles, deg").schema,
            1 + LEAST_JOINTS,
            1 + MAX_JOINTS,
        ),
    ),
)
POSTURES = listed(POSTURE, 2, MAX_POSTURES)


def _rows(value: YamlValue, _context: ScriptContext) -> FloatArray:
    """Read rows of one length."""
    rows = POSTURES(value)
    joints = len(rows[0]) - 1
    for item, row in zip(value.items, rows, strict=True):
        if len(row) != 1 + joints:
            raise item.wrong(f"Expected a time and {joints} angles, as in the first row.")
    return np.array(rows)


@dataclass(frozen=True, eq=False)
class FollowTrajectory(Step, word="trajectory"):
    """Move through postures at given times, on a smooth path, slower where limits require it.

    The arm first moves to the first posture, on any path round obstacles.

    Attributes:
        through: (m, 1 + n) rows of a time [s], from any zero, and a posture [rad].
    """

    through: Annotated[
        FloatArray, Kind(_rows, POSTURES.schema).about("Rows of a time, s, and all angles, deg")
    ]

    def build(self, plan: PlanState) -> PlanState:
        """Plan the way to the start, and the trajectory.

        Raises BlockedError with the time at which two parts would meet, and InputError for a
        posture beyond the limits, or of another number of joints.
        """
        require_turning(plan.chain)
        times, postures = frozen(self.through[:, 0]), frozen(self.through[:, 1:])
        joints, columns = plan.chain.n, postures.shape[1]
        if columns != joints:
            raise InputError(f"The arm has {joints} joints; a row of this has {columns} angles.")
        path = TrajectoryPath(plan.chain, times, postures)
        plan = plan.move_to(path.start, f"{TRAJECTORY}: approach")
        arm, world = plan.plan_context.arm, plan.world
        if world is not None:
            check_clear(path, world, plan.state.gripper_setpoint, CLEARANCE, path.moment)
        untimed = UntimedTrajectory(arm, world, plan.state, (path,))
        return plan.with_action(TRAJECTORY, untimed, plan.standing(path.end).state)
