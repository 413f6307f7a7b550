"""A plan: paths one after another, timed, and checked for contacts before anything moves."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from katana450.caching import cached_property
from katana450.errors import BlockedError, InputError
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld, Fingerprint
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.clearance import Clearance, Sweep, SweptClearance
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.pacing import fastest
from katana450.maths.planning.path import Path, point_derivatives
from katana450.maths.planning.scaling import Bounds, Scaling

MARGIN = MIN_CLEARANCE + 1e-3
"""Distance [m] that a plan keeps: more than the distance at which the arm stops, so that rounding
never stops it.
"""

JOIN_TOLERANCE = 1e-7
"""Maximum gap [rad] between paths that follow each other."""

CHORDS = 1000
"""Number of chords that measure the length of the tool's path."""


@dataclass(frozen=True, eq=False)
class PathMotion:
    """The joints at some tau, (n,) each: q [rad] and its derivatives by tau [rad/s, rad/s^2]."""

    q: FloatArray
    first: FloatArray
    second: FloatArray


@dataclass(frozen=True, eq=False)
class Segment:
    """One path and its scaling; the arm rests at both ends."""

    path: Path
    scaling: Scaling

    def at(self, tau: float) -> PathMotion:
        """Return the joints at `tau`, from 0 to the scaling's span [s]."""
        pace = self.scaling.pace(tau)
        joints = self.path.joints(Jet.variable(pace.sigma))
        q, q1, q2 = (
            np.array(values) for values in zip(*(j.derivatives()[:3] for j in joints), strict=True)
        )
        if tau >= self.scaling.span:
            # The goal itself, not what rounding makes of it.
            q = self.path.end
        # A path that touches a limit exceeds it by rounding. No setpoint may.
        q = self.path.chain.clamp(q)
        return PathMotion(frozen(q), q1 * pace.first, q2 * pace.first**2 + q1 * pace.second)

    @cached_property
    def length(self) -> float:
        """The length of the tool point's path [m]."""
        points = point_derivatives(self.path, np.linspace(0.0, 1.0, CHORDS + 1))[0]
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    @cached_property
    def sweep(self) -> Sweep:
        """The sweep of the path, for clearance checks."""
        return Sweep(self.path)


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest contact on a plan. tau: its time at full speed without the ramps [s]."""

    contact: Contact
    tau: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Segments in their order; tau runs through all of them.

    Attributes:
        segments: the timed paths.
        clear_of: fingerprint of the world in which the plan is clear; None when it was not checked.
        fingers: angle of the finger joint meanwhile [rad].
        nearest: the minimum clearance on the whole path; None where nothing can meet or nothing was
            checked.
        slow_span, slow_fraction: the tau [s] in which zones bound the fraction of full speed.
    """

    segments: tuple[Segment, ...]
    clear_of: Fingerprint | None = None
    fingers: float = 0.0
    nearest: Nearest | None = None
    slow_span: float = 0.0
    slow_fraction: float = 1.0

    @cached_property
    def begins(self) -> tuple[float, ...]:
        """The tau at which each segment begins, and that at the end of the last [s]."""
        spans = [segment.scaling.span for segment in self.segments]
        return tuple(np.cumsum([0.0, *spans]).tolist())

    @property
    def span(self) -> float:
        """The tau at the end [s]."""
        return self.begins[-1]

    @property
    def duration(self) -> float:
        """The duration [s] at full speed, from rest to rest of every segment."""
        return self.duration_at(1.0)

    def duration_at(self, fraction: float) -> float:
        """Return the duration [s] at ``fraction`` of full speed, with rest between segments."""
        delay = self.slow_span * max(0.0, 1.0 / self.slow_fraction - 1.0 / fraction)
        return delay + math.fsum(item.scaling.duration_at(fraction) for item in self.segments)

    @property
    def length(self) -> float:
        """The length of the tool point's path [m]."""
        return math.fsum(segment.length for segment in self.segments)

    @cached_property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        path = self.segments[0].path
        return frozen(path.chain.clamp(path.start))

    @cached_property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        path = self.segments[-1].path
        return frozen(path.chain.clamp(path.end))

    def segment_at(self, tau: float) -> int:
        """Return the index of the segment at `tau` [s], from 0 to `span`."""
        return min(max(bisect_right(self.begins, tau) - 1, 0), len(self.segments) - 1)

    def q(self, tau: float) -> FloatArray:
        """Return the joint angles (n,) [rad] at `tau` [s], from 0 to `span`."""
        number = self.segment_at(tau)
        return self.segments[number].at(tau - self.begins[number]).q

    def postures(self, count: int, tau: float = 0.0) -> FloatArray:
        """Return joint angles (count, n) [rad] evenly from `tau` [s] to the end, for a preview."""
        return np.array(
            [self.q(instant) for instant in np.linspace(tau, self.span, count).tolist()]
        )


def plan(
    paths: Sequence[Path],
    bounds: Bounds,
    world: CollisionWorld | None = None,
    fingers: float = 0.0,
    margin: float = MARGIN,
    timing: Callable[[Path, Bounds], Scaling] = fastest,
) -> Plan:
    """Return the paths as a plan with rest between them, each as fast as `bounds` allow.

    Args:
        paths: the paths, each of which begins where the one before ends.
        bounds: the limits of the motion.
        world: the obstacles, with anything that the gripper holds; None skips all checks.
        fingers: angle of the finger joint meanwhile [rad].
        margin: distance to keep [m]; parts that are nearer at the start come no nearer.
        timing: returns another scaling of a path, within the bounds.

    Raises:
        BlockedError: a path comes too near to something. The message names parts, distance and
            place.
        InputError: the paths do not meet each other.
    """
    if not paths:
        raise InputError("A plan needs at least one path.")
    for number, (before, after) in enumerate(pairwise(paths), 1):
        gap = float(np.abs(after.start - before.end).max())
        if gap > JOIN_TOLERANCE:
            raise InputError(
                f"Path {number + 1} begins {np.degrees(gap):.3g} deg from where path {number} ends."
            )
    # A path that is used repeatedly is checked and timed once.
    once = {id(path): path for path in paths}
    checked = {
        key: None if world is None else _clearance(path, world, fingers, margin)
        for key, path in once.items()
    }
    timed = {key: Segment(path, timing(path, bounds)) for key, path in once.items()}
    clearances = [checked[id(path)] for path in paths]
    segments = tuple(timed[id(path)] for path in paths)
    whole_plan = Plan(segments, None if world is None else world.fingerprint, fingers)
    pieces = [
        Nearest(clearance.contact, begin + segment.scaling.tau(clearance.sigma))
        for clearance, segment, begin in zip(clearances, segments, whole_plan.begins, strict=False)
        if clearance is not None
    ]
    return replace(whole_plan, nearest=min(pieces, key=lambda n: n.contact.distance, default=None))


def check_clear(
    path: Path,
    world: CollisionWorld,
    fingers: float,
    margin: float = MARGIN,
    place: Callable[[float], str] = lambda sigma: f"{100.0 * sigma:.0f} % along it",
) -> tuple[SweptClearance, Sweep]:
    """Return what shows that the whole of `path` keeps `margin`; raise BlockedError, as `plan`.

    ``place``: returns a place of the path in words.
    """
    sweep = Sweep(path)
    room = SweptClearance.about(world, margin, sweep.at(0.0, fingers), sweep.at(1.0, fingers))
    contact = sweep.blocked(room, fingers)
    if contact is None:
        return room, sweep
    x = sweep.at(contact.sigma, fingers)
    worst = room.worst(x)
    raise BlockedError(
        f"The path is blocked {place(contact.sigma)}, with the tool at {{point}}: "
        f"{{parts}} would {apart(worst.distance)}, and {1e3 * margin:g} mm are required. Lead the "
        "path around the obstacle, or move it.",
        forward(path.chain, x[:-1])[:3, 3].tolist(),
        parts=worst.parts,
    )


def _clearance(
    path: Path, world: CollisionWorld, fingers: float, margin: float
) -> Clearance | None:
    """Return the nearest contact on `path`; raise BlockedError if it is too near."""
    room, sweep = check_clear(path, world, fingers, margin)
    return sweep.nearest(room, fingers)


def apart(distance: float) -> str:
    """Return a distance [m] in words, for an error message."""
    if distance < 0.0:
        return f"overlap by {-1e3 * distance:.1f} mm"
    return f"be {1e3 * distance:.1f} mm apart"
