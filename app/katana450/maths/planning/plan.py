"""A plan: paths one after another, timed, and known to be clear, before anything moves."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from katana450.errors import BlockedError, InputError
from katana450.maths.collision.clearance import STOP
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import CollisionWorld, Fingerprint
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.clearance import Clearance, SweptClearance
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.pacing import fastest
from katana450.maths.planning.path import Path, point_derivatives
from katana450.maths.planning.scaling import Bounds, Scaling
from katana450.maths.planning.sweep import Sweep

MARGIN = STOP + 1e-3
"""[m] What a plan keeps: more than the arm stops at, so that rounding never stops it."""

JOIN_TOLERANCE = 1e-7
"""[rad] Paths that follow each other meet to this."""

CHORDS = 1000
"""By which the length of the tool's way is measured."""


@dataclass(frozen=True, eq=False)
class PathMotion:
    """Joints at some tau, (5,) each: q [rad] and its derivatives by tau [rad/s, rad/s^2]."""

    q: FloatArray
    first: FloatArray
    second: FloatArray


@dataclass(frozen=True, eq=False)
class Segment:
    """One path and its time; the arm rests at both ends."""

    path: Path
    scaling: Scaling

    def at(self, tau: float) -> PathMotion:
        """The joints at `tau`, from 0 to the scaling's span [s]."""
        pace = self.scaling.pace(tau)
        joints = self.path.joints(Jet.variable(pace.sigma))
        q, q1, q2 = (
            np.array(each) for each in zip(*(j.derivatives()[:3] for j in joints), strict=True)
        )
        return PathMotion(frozen(q), q1 * pace.first, q2 * pace.first**2 + q1 * pace.second)

    @cached_property
    def length(self) -> float:
        """Of the tool point's way [m]."""
        points = point_derivatives(self.path, np.linspace(0.0, 1.0, CHORDS + 1))[0]
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    @cached_property
    def sweep(self) -> Sweep:
        """What it sweeps."""
        return Sweep(self.path)


@dataclass(frozen=True, eq=False)
class Nearest:
    """Where on a plan two parts come nearest. tau: when at full speed but for the ramps [s]."""

    contact: Contact
    tau: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Segments in their order, tau running through them all.

    clear_of, fingers: the world it is known to be clear of, with the finger joint at that angle
    [rad]; None when nothing was looked at. nearest: the least clearance on the whole
    way; None where nothing can meet or nothing was looked at.
    """

    segments: tuple[Segment, ...]
    clear_of: Fingerprint | None = None
    fingers: float = 0.0
    nearest: Nearest | None = None

    @cached_property
    def begins(self) -> tuple[float, ...]:
        """Tau at which each segment begins, and the last ends [s]."""
        spans = [segment.scaling.span for segment in self.segments]
        return tuple(np.cumsum([0.0, *spans]).tolist())

    @property
    def span(self) -> float:
        """Tau at the end [s]."""
        return self.begins[-1]

    @property
    def duration(self) -> float:
        """[s] at full speed, from rest to rest of every segment."""
        return sum(segment.scaling.duration for segment in self.segments)

    @property
    def length(self) -> float:
        """Of the tool point's way [m]."""
        return sum(segment.length for segment in self.segments)

    @cached_property
    def start(self) -> FloatArray:
        """(5,) where it begins [rad]."""
        return self.segments[0].path.start

    @cached_property
    def end(self) -> FloatArray:
        """(5,) where it ends [rad]."""
        return self.segments[-1].path.end

    def q(self, tau: float) -> FloatArray:
        """(5,) the joints at `tau` [s], from 0 to `span` [rad]."""
        number = min(max(bisect_right(self.begins, tau) - 1, 0), len(self.segments) - 1)
        return self.segments[number].at(tau - self.begins[number]).q

    def postures(self, count: int) -> FloatArray:
        """(count, 5) joints evenly in tau, from start to end [rad]: a preview of the way."""
        return np.array([self.q(tau) for tau in np.linspace(0.0, self.span, count).tolist()])


def plan(
    paths: Sequence[Path],
    bounds: Bounds,
    world: CollisionWorld | None = None,
    fingers: float = 0.0,
    margin: float = MARGIN,
) -> Plan:
    """The paths in their order, each as fast as `bounds` allow, with the arm at rest between them.

    world: what must not be touched, with whatever the gripper holds; without one nothing is looked
    at. fingers: the angle of the finger joint meanwhile [rad]. margin: the distance kept [m]; what
    is nearer at the start comes no nearer. Raises BlockedError where that cannot be: which parts,
    how near, where; InputError when the paths do not meet each other.
    """
    if not paths:
        raise InputError("A plan needs a path at least.")
    for number, (before, after) in enumerate(pairwise(paths), 1):
        gap = float(np.abs(after.start - before.end).max())
        if gap > JOIN_TOLERANCE:
            raise InputError(
                f"Path {number + 1} begins {np.degrees(gap):.3g} deg from where path {number} ends."
            )
    # A path that is gone along again is looked at and timed once.
    once = {id(path): path for path in paths}
    looked = {
        key: None if world is None else _clearance(path, world, fingers, margin)
        for key, path in once.items()
    }
    timed = {key: Segment(path, fastest(path, bounds)) for key, path in once.items()}
    clearances = [looked[id(path)] for path in paths]
    segments = tuple(timed[id(path)] for path in paths)
    found = Plan(segments, None if world is None else world.fingerprint, fingers)
    each = [
        Nearest(clearance.contact, begin + segment.scaling.tau(clearance.sigma))
        for clearance, segment, begin in zip(clearances, segments, found.begins, strict=False)
        if clearance is not None
    ]
    return replace(found, nearest=min(each, key=lambda n: n.contact.distance, default=None))


def check_clear(path: Path, world: CollisionWorld, fingers: float, margin: float = MARGIN) -> None:
    """BlockedError, as of `plan`, unless the whole of `path` keeps `margin` [m]."""
    _clearance(path, world, fingers, margin, canonical=False)


def _clearance(
    path: Path, world: CollisionWorld, fingers: float, margin: float, *, canonical: bool = True
) -> Clearance | None:
    """The nearest on `path`, if it is asked for; BlockedError where it is too near."""
    sweep = Sweep(path)
    room = SweptClearance.about(world, margin, sweep.at(0.0, fingers), sweep.at(1.0, fingers))
    met = sweep.blocked(room, fingers)
    if met is None:
        return sweep.nearest(room, fingers) if canonical else None
    one, other = met.contact.parts
    x, y, z = (1e3 * forward(path.chain, sweep.at(met.sigma, fingers)[:5])[:3, 3]).tolist()
    raise BlockedError(
        f"The way is blocked {100.0 * met.sigma:.0f} % along it, with the tool at ({x:.0f}, "
        f"{y:.0f}, {z:.0f}) mm: {one} and {other} would be {_apart(met.contact.distance)}, and "
        f"{1e3 * margin:g} mm are kept. Lead the way round, or move what is there."
    )


def _apart(distance: float) -> str:
    if distance < 0.0:
        return f"{-1e3 * distance:.1f} mm in each other"
    return f"{1e3 * distance:.1f} mm apart"
