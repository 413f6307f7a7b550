"""Figures that the documents of the arm state: times of a stop, and rates."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.state.arm_report import ArmMode
from katana450.extensions.real_arm.codec.requests import More, SendSplines
from katana450.extensions.real_arm.driver.spline_motion import SplineStream
from tests.conftest import LONG
from tests.real_arm.paper_arm import JOINTS, MAP
from tests.real_arm.test_programs_with_emulator import PERIOD, EmulatorOnPaper


def moving(delay: float, seconds: float) -> tuple[EmulatorOnPaper, float, list[float]]:
    """Return the emulated arm amid a motion, the time, and the times of its positions."""
    emulator = EmulatorOnPaper(JOINTS, delay, 0.0)
    t, times = 0.0, []
    while t < seconds:
        size = 0.35 * (1.0 - math.cos(1.6 * t))
        joints = JOINTS + size * np.array([1.0, -0.8, 0.5, 1.0, 1.0, 0.0])
        emulator.machine.steer(joints, t, stopped=False)
        emulator.advance(t)
        times.append(emulator.machine.arm.t)
        t += PERIOD
    assert emulator.machine.mode is ArmMode.MOVING, emulator.machine.note
    return emulator, t, times


@pytest.mark.parametrize(("delay", "least", "most"), [(1e-3, 0.05, 0.2), (0.045, 0.3, 0.45)])
def test_stop_of_the_emulated_arm_takes_the_stated_time(
    delay: float, least: float, most: float
) -> None:
    emulator, t, _ = moving(delay, 1.0)
    stop = None
    while stop is None and t < 3.0:
        emulator.machine.steer(JOINTS, t, stopped=True)
        emulator.advance(t)
        report = emulator.machine.answer().report
        assert report is not None
        stop = report.measured_stop
        t += PERIOD
    assert stop is not None
    assert least < stop.time < most
    assert stop.angle > 0.0


def test_positions_come_four_times_a_second_with_replies_of_40_milliseconds() -> None:
    _, _, times = moving(0.04, 5.0)
    moments = sorted({t for t in times if t > 1.0})
    rate = (len(moments) - 1) / (moments[-1] - moments[0])
    assert 3.5 < rate < 8.0
    assert max(b - a for a, b in itertools.pairwise(moments)) < 0.35


@settings(max_examples=300 if LONG else 40)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.floats(0.005, 0.06))
def test_no_stream_of_setpoints_overflows_a_coefficient(
    seed: int, wild: float, longest: float
) -> None:
    """Setpoints leap anywhere within the limits, at irregular times."""
    rng = np.random.default_rng(seed)
    stream = SplineStream(MAP.encoders(JOINTS).astype(int), MAP.speed)
    place = MAP.encoders(JOINTS)
    t, count = 0.0, 0
    for _ in range(150):
        t += float(rng.uniform(0.001, longest))
        if rng.random() < wild:
            place = np.where(rng.random(6) < 0.5, MAP.lower, MAP.upper).astype(float)
        stream.add(t, place)
        while (segment := stream.cut()) is not None:
            count += 1
            # Raises InputError for a number beyond 16 bits.
            packet = SendSplines(segment.axes(), More.START)
            assert len(packet.payload) == 75
            numbers = np.frombuffer(packet.payload[1:73], ">i2").reshape(6, 6)
            assert (numbers[:, 1] == segment.end.position).all()
    assert count > 0 or t < 0.1
