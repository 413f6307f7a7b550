"""One motion of the arm: setpoints in, packets of polynomials out, and where the arm should be."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from katana450.arm.control.session import MAX_STEP_TIME
from katana450.extensions.real_arm.codec.requests import More, SendSplines
from katana450.extensions.real_arm.splines import (
    SEGMENT_TICKS,
    SEGMENT_TIME,
    SPEED_UNIT,
    TICK,
    SplineSegment,
    SplineStream,
    joined,
)
from katana450.maths.geometry.arrays import FloatArray, IntArray

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
