"""One motion of the arm: setpoints in, packets of polynomials out, and where the arm should be.

Setpoints become cubic polynomials in the numbers of the protocol. All segments are 8 ticks long.
For that length every whole position and every speed in 64ths of an encoder per tick can be joined
exactly: with v in these units and a travel of m encoders,

    p1 = v0,  p2 = 48 m - 2 (2 v0 + v1),  p3 = 8 (v0 + v1) - 128 m

are whole numbers, and the polynomial ends at exactly p0 + m with exactly v1. So only positions and
speeds at knots are rounded, each by itself, and no error accumulates.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from itertools import islice

import numpy as np

from katana450.arm.control.session.session import MAX_STEP_TIME
from katana450.extensions.real_arm.codec.requests import AxisSegment, More, SendSplines
from katana450.maths.geometry.arrays import FloatArray, IntArray

TICK = 0.01
"""[s] Unit of time of the arm."""

SEGMENT_TICKS = 8
"""Length of every segment."""

SEGMENT_TIME = SEGMENT_TICKS * TICK
"""[s] Length of every segment."""

SPEED_UNIT = 64
"""Units of speed per encoder per tick."""

MAX_SPEED_CHANGE = 300
"""[encoders per tick] Maximum change of speed in a segment, so that p2 fits into 16 bits."""

MAX_DEVIATION = 100
"""[encoders] Maximum difference between a travel and its mean speed, so that p2 and p3 fit."""

LARGEST = 32_000
"""[encoders] Distance from 0 that no polynomial exceeds. The limits of all axes are 31000."""

LONGEST_GAP = 1.5 * TICK
"""[s] Time between setpoints after which the second one begins a motion if it differs."""


@dataclass(frozen=True, eq=False)
class SplineKnot:
    """Knot between two segments: positions (6,) [encoders], speeds (6,) [encoders/tick / 64]."""

    position: IntArray
    speed: IntArray

    @property
    def is_at_rest(self) -> bool:
        """True if all speeds are zero."""
        return not self.speed.any()


@dataclass(frozen=True, eq=False)
class SplineSegment:
    """A segment of 8 ticks for all axes, from one knot to the next."""

    start: SplineKnot
    end: SplineKnot

    @property
    def travel(self) -> IntArray:
        """Travel of the axes, (6,) [encoders]."""
        return self.end.position - self.start.position

    def axes(self) -> tuple[AxisSegment, ...]:
        """Return the polynomials of the axes as they are sent."""
        v0, v1, m = self.start.speed, self.end.speed, self.travel
        p2 = 48 * m - 2 * (2 * v0 + v1)
        p3 = 8 * (v0 + v1) - 128 * m
        rows = np.stack((self.end.position, self.start.position, v0, p2, p3), axis=1).tolist()
        return tuple(AxisSegment(SEGMENT_TICKS, *row) for row in rows)

    def at(self, tick: float) -> FloatArray:
        """Return the positions (6,) [encoders] at ``tick``, 0 to 8."""
        return np.array([axis.at(tick) for axis in self.axes()])


def joined(start: SplineKnot, position: FloatArray, speed: FloatArray) -> SplineSegment:
    """Return the segment from ``start`` towards ``position`` and ``speed``.

    It ends there, rounded, or as near to it as 16 bits allow.

    Args:
        start: Knot where it begins.
        position: (6,) [encoders].
        speed: (6,) [encoders per tick].
    """
    change = MAX_SPEED_CHANGE * SPEED_UNIT
    wanted = np.rint(speed * SPEED_UNIT).astype(np.int64)
    v1 = np.clip(wanted, start.speed - change, start.speed + change)
    # So slow that the axis can stop within the segment after this one, before its numbers end.
    half = SEGMENT_TICKS // 2
    forward = SPEED_UNIT * start.position + half * start.speed
    least, most = ((SPEED_UNIT * end - forward) // SEGMENT_TICKS for end in (-LARGEST, LARGEST))
    v1 = np.clip(v1, least, most)
    mean = (start.speed + v1) * SEGMENT_TICKS // (2 * SPEED_UNIT)
    m = np.rint(position).astype(np.int64) - start.position
    m = np.clip(m, mean - MAX_DEVIATION, mean + MAX_DEVIATION)
    stop = start.position + half * v1 // SPEED_UNIT
    m = np.clip(m, -LARGEST - stop, LARGEST - stop)
    return SplineSegment(start, SplineKnot(start.position + m, v1))


class SplineStream:
    """One motion from rest: setpoints in, segments out, at most one per 80 ms of setpoints.

    Attributes:
        is_still: Whether the newest setpoint is that before it.
    """

    def __init__(self, start: IntArray, speed: FloatArray) -> None:
        """Create a stream from rest at ``start`` (6,) [encoders].

        speed: (6,) maximum of each axis [encoders per tick], to which setpoints are slowed down.
        """
        self._knot = SplineKnot(np.array(start, np.int64), np.zeros(len(start), np.int64))
        self._max_speed = speed
        self._times: deque[float] = deque()
        self._points: deque[FloatArray] = deque()
        self._end = self._moved_at = 0.0
        self.is_still = True

    @property
    def knot(self) -> SplineKnot:
        """End of the newest segment."""
        return self._knot

    def still_for(self) -> float:
        """Return the time [s] for which the setpoints have not changed."""
        return self._times[-1] - self._moved_at if self._times else 0.0

    def add(self, t: float, encoders: FloatArray) -> None:
        """Add the setpoint (6,) [encoders] at ``t`` [s]. One that is not newer is ignored."""
        if not self._times:
            self._append(t - TICK, self._knot.position.astype(float))
            self._end = t - TICK + SEGMENT_TIME
        if t <= self._times[-1]:
            return
        if t - self._times[-1] > LONGEST_GAP and self.is_still:
            # Setpoints at rest are rare, and a motion begins one tick before its first setpoint.
            self._append(t - TICK, self._points[-1])
        bound = self._max_speed * (t - self._times[-1]) / TICK
        step = np.clip(encoders - self._points[-1], -bound, bound)
        self.is_still = not step.any()
        if not self.is_still:
            self._moved_at = t
        self._append(t, self._points[-1] + step)

    def _append(self, t: float, point: FloatArray) -> None:
        self._times.append(t)
        self._points.append(point)

    def cut(self) -> SplineSegment | None:
        """Return the next segment, or None while its setpoints are not complete."""
        if not self._times or self._times[-1] < self._end + TICK / 2:
            return None
        position, speed = self._at(self._end)
        # Between setpoints that leap, the parabola may be faster than any axis.
        speed = np.clip(speed, -self._max_speed, self._max_speed)
        segment = joined(self._knot, position, speed)
        self._knot = segment.end
        self._end += SEGMENT_TIME
        while len(self._times) > 3 and self._times[2] < self._end - SEGMENT_TIME:
            self._times.popleft()
            self._points.popleft()
        return segment

    def _at(self, t: float) -> tuple[FloatArray, FloatArray]:
        """Return position and speed per tick at ``t`` of the parabola through three setpoints."""
        near = bisect_left(self._times, t - TICK / 100)
        first = min(max(near - 1, 0), max(len(self._times) - 3, 0))
        times = np.array(list(islice(self._times, first, first + 3)))
        points = np.array(list(islice(self._points, first, first + 3)))
        values = np.polynomial.polynomial.polyfit((times - t) / TICK, points, len(times) - 1)
        return values[0], values[1]


AHEAD = 4
"""Segments that wait in the arm when the motion starts, and at most later."""

LINGER = 0.4
"""[s] Time of rest after which a motion ends. A new one must wait until the arm has ended it."""

LATEST = SEGMENT_TIME
"""[s] Motion left in the arm below which it is braked if no further segment is there."""

BRAKE_FRACTION = 0.09
"""Part of the maximum speed that a brake takes in a segment: 2 encoders per tick^2, the larger of
the two accelerations of the firmware. A faster one would look like a collision."""

RESERVE = 1.5 * SEGMENT_TIME
"""[s] Motion left in the arm above which another request may come before its next segment."""

SLACK = 0.04
"""[s] Lack that is none: setpoints come at any time within a tick."""

CATCH_UP_TIME = 1.0
"""[s] Time constant with which motion that late setpoints took from the arm is made up."""

MAX_SLOWING, SLOWING_STEP = 0.3, 0.005
"""Largest part by which a motion is slowed down meanwhile, and its largest change per setpoint."""

KEPT_TIME = 2.0
"""[s] Past of the motion that is kept for late measurements."""


class SplineMotion:
    """A motion from rest to rest.

    Attributes:
        is_late: Whether the setpoints came too late, so that the motion was ended by a brake.
    """

    def __init__(self, start: IntArray, speed: FloatArray) -> None:
        """Create a motion from rest at ``start`` (6,) [encoders].

        speed: (6,) maximum of each axis [encoders per tick].
        """
        self._stream = SplineStream(start, speed)
        self._speed = speed
        self._ready: deque[tuple[SplineSegment, bool]] = deque()
        self._sent: deque[SplineSegment] = deque()
        self._dropped = 0
        self._started: float | None = None
        self._is_closed = False
        self._has_sent_last = False
        self._start = start.astype(float)
        self._t, self._time, self._lead, self._slowing = -math.inf, 0.0, 0.0, 1.0
        self.is_late = False

    @property
    def takes_setpoints(self) -> bool:
        """True until the motion has its last segment."""
        return not self._is_closed

    @property
    def target(self) -> IntArray:
        """End of the newest segment, (6,) [encoders]."""
        return self._stream.knot.position

    def add(self, t: float, encoders: FloatArray) -> None:
        """Add the setpoint (6,) [encoders] at ``t`` [s]."""
        if self._is_closed:
            return
        self._stream.add(self._stream_time(t), encoders)
        while not self._is_closed and (segment := self._stream.cut()) is not None:
            is_still = segment.start.is_at_rest and not segment.travel.any()
            self._is_closed = is_still and self._stream.still_for() >= LINGER
            self._ready.append((segment, self._is_closed))

    def _stream_time(self, t: float) -> float:
        """Return the time [s] in the motion of a setpoint of time ``t`` [s]: ``t`` without delays.

        The session moves the setpoint for MAX_STEP_TIME at most, however late a tick is. What the
        arm then lacks is made up by a motion that is slightly slower, until as much waits in the
        arm as at its start.
        """
        dt = t - self._t
        self._t = t
        if math.isinf(dt):
            self._time = t
            return t
        if not self._stream.is_still:
            dt = min(dt, MAX_STEP_TIME)
        lack = 0.0 if self._started is None else self._lead - self._time + t - self._started
        wanted = 1.0 + min(max(lack - SLACK, 0.0) / CATCH_UP_TIME, MAX_SLOWING)
        self._slowing += min(max(wanted - self._slowing, -SLOWING_STEP), SLOWING_STEP)
        self._time += dt * self._slowing
        return self._time

    def next_packet(self, now: float) -> SendSplines | None:
        """Return the packet to send at ``now`` [s], or None. ``sent`` must follow."""
        if not self._ready:
            self._brake(now)
        if not self._ready or (self._started is not None and self._left(now) > self._room):
            return None
        segment, is_last = self._ready[0]
        if is_last:
            more = More.LAST
        elif self._started is None and len(self._sent) < AHEAD - 1:
            more = More.STORE
        else:
            more = More.START
        return SendSplines(segment.axes(), more)

    def sent(self, packet: SendSplines, t: float) -> None:
        """Note that the arm confirmed ``packet``, the one that was returned last, at ``t`` [s]."""
        segment, self._has_sent_last = self._ready.popleft()
        self._sent.append(segment)
        if self._started is None and packet.more != More.STORE:
            self._started, self._lead = t, self._time
        while self._started is not None and len(self._sent) > KEPT_TIME / SEGMENT_TIME:
            self._sent.popleft()
            self._dropped += 1

    def position_at(self, t: float) -> FloatArray:
        """Return the positions (6,) [encoders] where the arm should be at ``t`` [s]."""
        tick = 0.0 if self._started is None else (t - self._started) / TICK
        if tick <= 0.0 or not self._sent:
            return self._start
        index, rest = divmod(tick, SEGMENT_TICKS)
        place = max(int(index) - self._dropped, 0)
        if place >= len(self._sent):
            return self._sent[-1].end.position.astype(float)
        return self._sent[place].at(rest)

    def can_wait(self, now: float) -> bool:
        """Return whether what waits in the arm at ``now`` [s] leaves time for an exchange."""
        return self._started is None or self._left(now) > RESERVE

    def has_ended(self, now: float) -> bool:
        """Return whether the arm has played the whole motion at ``now`` [s]."""
        return self._started is not None and self._has_sent_last and self._left(now) < 0.0

    @property
    def _room(self) -> float:
        return (AHEAD - 1) * SEGMENT_TIME

    def _left(self, now: float) -> float:
        """Return the time of motion that waits in the arm [s]."""
        assert self._started is not None
        return (self._dropped + len(self._sent)) * SEGMENT_TIME - (now - self._started)

    def _brake(self, now: float) -> None:
        """End a motion whose setpoints are late by segments to rest, before the arm runs dry."""
        if self._started is None or self._is_closed or self._left(now) > LATEST:
            return
        self._is_closed, knot = True, self._sent[-1].end
        self.is_late = not knot.is_at_rest
        step = self._speed * BRAKE_FRACTION
        while not self._ready or not knot.is_at_rest:
            before = knot.speed / SPEED_UNIT
            speed = before - np.clip(before, -step, step)
            place = knot.position + 0.5 * (before + speed) * SEGMENT_TICKS
            segment = joined(knot, place, speed)
            knot = segment.end
            self._ready.append((segment, knot.is_at_rest))
