"""Segments follow the setpoints within half an encoder, join exactly, and fit into 16 bits."""

from __future__ import annotations

import itertools
from itertools import pairwise

import numpy as np

from katana450.arm.control.session.session import MAX_STEP_TIME
from katana450.extensions.real_arm.codec.requests import More, SendSplines
from katana450.extensions.real_arm.driver.spline_motion import (
    SEGMENT_TICKS,
    TICK,
    SplineMotion,
    SplineSegment,
    SplineStream,
)
from katana450.maths.geometry.arrays import FloatArray
from tests.conftest import LONG
from tests.real_arm.paper_arm import HOME, MAP

START = np.array([1000, -12000, -15000, 15000, 9000, 20000])
TICKS = np.arange(SEGMENT_TICKS + 1)


def ticks_from(first: int, end: int) -> FloatArray:
    return np.arange(first, end, dtype=np.float64) * TICK


def cut(setpoints: FloatArray, times: FloatArray) -> list[SplineSegment]:
    """Return the segments of setpoints (k, 6) [encoders]."""
    stream = SplineStream(START, MAP.speed)
    segments = []
    for t, point in zip(times, setpoints, strict=True):
        stream.add(float(t), point)
        while (segment := stream.cut()) is not None:
            segments.append(segment)
    return segments


def positions(segments: list[SplineSegment]) -> FloatArray:
    """Return the positions at each tick, (8 n + 1, 6)."""
    rows = [segment.at(tick) for segment in segments for tick in TICKS[:-1]]
    return np.array([*rows, segments[-1].at(SEGMENT_TICKS)])


def assert_joined(segments: list[SplineSegment]) -> None:
    for before, after in itertools.pairwise(segments):
        for a, b in zip(before.axes(), after.axes(), strict=True):
            # Equal as numbers, not nearly.
            assert a.at(SEGMENT_TICKS) == b.at(0) == a.target == b.p0
            assert a.speed_at(SEGMENT_TICKS) == b.speed_at(0)
    for segment in segments:
        packet = SendSplines(segment.axes(), More.START)
        assert SendSplines.read(packet.payload) == packet


def circle(period: float) -> tuple[FloatArray, FloatArray]:
    """Return setpoints on the clock of the ticks that begin and end at rest, and their times."""
    times = ticks_from(0, int(period / TICK) + 60)
    s = np.clip(times / period, 0.0, 1.0)
    phase = 2.0 * np.pi * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
    amplitude = np.array([2500.0, 4200.0, 1800.0, 3100.0, 900.0, 0.0])
    shift = np.arange(6)
    points = START + amplitude * (np.sin(phase[:, None] + shift) - np.sin(shift))
    return np.asarray(points, np.float64), times


def test_circle_is_followed_within_half_an_encoder() -> None:
    setpoints, times = circle(3.0)
    segments = cut(setpoints, times)
    assert_joined(segments)
    places = positions(segments)
    # The stream begins one tick before the first setpoint, at the start.
    plan = np.vstack([START, setpoints])[: len(places)]
    knots = slice(0, None, SEGMENT_TICKS)
    assert np.abs(places[knots] - plan[knots]).max() <= 0.5
    assert np.abs(places - plan).max() < 0.6
    assert segments[-1].end.is_at_rest


def test_error_does_not_accumulate() -> None:
    times = ticks_from(1, 20_000 if LONG else 4_000)
    drift = np.minimum(0.013 * np.arange(1, len(times) + 1), 1e4)
    setpoints = START + drift[:, None] * np.array([1, -1, 0.5, 0.3, -0.7, 0])
    places = positions(cut(setpoints, times))
    plan = np.vstack([START, setpoints])[: len(places)]
    assert np.abs(places[16:] - plan[16:]).max() < 0.6


def test_setpoint_beyond_the_speed_is_reached_at_the_maximum_speed() -> None:
    times = ticks_from(1, 200)
    setpoints = np.tile(START + np.array([3000, 3000, 3000, -3000, -3000, 0]), (len(times), 1))
    segments = cut(setpoints, times)
    assert_joined(segments)
    speeds = np.abs(np.diff(positions(segments), axis=0)).max(axis=0)
    assert (speeds <= 1.3 * MAP.speed).all()
    assert (segments[-1].end.position == setpoints[-1]).all()


def test_late_and_irregular_setpoints_are_followed() -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.008, 0.014, 300))
    setpoints = START + 3000 * np.sin(times)[:, None] * np.array([1, 1, 0.4, 1, 1, 0])
    segments = cut(setpoints, times)
    assert_joined(segments)
    grid = times[0] - TICK + np.arange(len(segments) * SEGMENT_TICKS + 1) * TICK
    plan = START + 3000 * np.sin(grid)[:, None] * np.array([1, 1, 0.4, 1, 1, 0])
    assert np.abs(positions(segments) - plan)[16:].max() < 1.0


def test_motion_after_a_rest_begins_with_its_first_setpoint() -> None:
    stream = SplineStream(START, MAP.speed)
    times = [0.01, 0.09, 0.17, 0.25, *(0.25 + TICK * np.arange(1, 30))]
    ends = []
    for t in times:
        travel = max(t - 0.25, 0.0) ** 2 * 20_000
        stream.add(t, START + np.array([travel, 0, 0, 0, 0, 0]))
        while (segment := stream.cut()) is not None:
            ends.append(segment.end.position[0] - START[0])
    assert ends[:3] == [0, 0, 0]
    assert np.abs(ends[3] - (0.32 - 0.25) ** 2 * 20_000) <= 1.0


def test_still_setpoints_end_at_rest() -> None:
    stream = SplineStream(START, MAP.speed)
    assert stream.cut() is None
    for tick in range(1, 50):
        stream.add(tick * TICK, START + min(tick, 20) * np.array([5, 0, 0, 0, 0, 0]))
        stream.cut()
    assert stream.knot.is_at_rest
    assert stream.still_for() > 0.25
    assert (stream.knot.position == START + np.array([100, 0, 0, 0, 0, 0])).all()


DIRECTIONS = np.array([2000.0, -1500.0, 1000.0, 2000.0, -1800.0, 0.0])
MAX_ACCELERATION = 0.8
"""[encoders/tick^2] Of the setpoints below it is 0.2."""


def played(late_ticks: dict[int, float], seconds: float = 4.0) -> list[tuple[float, SendSplines]]:
    """Return the packets with their times of a swing whose ticks are late by so much [s]."""
    motion = SplineMotion(HOME, MAP.speed)
    packets, t, moved, tick = [], 0.0, 0.0, 0
    while t < seconds:
        dt = 0.01 + late_ticks.get(tick, 0.0)
        # As the session does after a late tick.
        t, moved, tick = t + dt, moved + min(dt, MAX_STEP_TIME), tick + 1
        motion.add(t, HOME + DIRECTIONS * (1.0 - np.cos(moved)))
        while (packet := motion.next_packet(t)) is not None:
            motion.sent(packet, t)
            packets.append((t, packet))
    assert not motion.is_late
    return packets


def largest_acceleration(packets: list[tuple[float, SendSplines]]) -> float:
    """Return the largest change of speed at the knots [encoders/tick^2]."""
    speeds = np.array([[axis.p1 / 64 for axis in packet.segments] for _, packet in packets])
    return float(np.abs(np.diff(speeds, axis=0)).max()) / 8


def test_punctual_setpoints_are_not_slowed_down() -> None:
    packets = played({})
    assert largest_acceleration(packets) < 0.4
    end = np.array([axis.target for axis in packets[-1][1].segments])
    start = packets[0][0] - 0.09
    expected = HOME + DIRECTIONS * (1.0 - np.cos(start + 0.08 * len(packets)))
    assert np.abs(end - expected).max() <= 0.5


def test_late_ticks_make_no_jerk_and_are_made_up() -> None:
    late = {60: 0.15, 140: 0.12, 230: 0.1}
    packets = played(late)
    assert largest_acceleration(packets) < MAX_ACCELERATION
    # 0.22 s were lost, and after the last late tick most of it is made up.
    starts = [t - 0.08 * number for number, (t, _) in enumerate(packets)]
    assert starts[-1] - starts[5] < 0.09
    for (_, before), (_, after) in pairwise(packets):
        assert [a.p0 for a in after.segments] == [b.target for b in before.segments]
