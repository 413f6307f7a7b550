"""A motion stays smooth, and the arm supplied, when the control loop is late."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from katana450.arm.control.session import MAX_STEP_TIME
from katana450.extensions.real_arm.codec.requests import SendSplines
from katana450.extensions.real_arm.driver.spline_motion import SplineMotion
from tests.real_arm.paper_arm import HOME, MAP

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
    begun = packets[0][0] - 0.09
    expected = HOME + DIRECTIONS * (1.0 - np.cos(begun + 0.08 * len(packets)))
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
