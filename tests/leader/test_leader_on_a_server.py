"""`katana450 leader` with an emulated leader and a real server."""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.extensions.leader.joint_map import JointMap
from katana450.extensions.motor_bus.calibration import decoded_calibration
from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.server.api import answers, requests
from tests.browser.server import AppServer
from tests.waiting import until

pytest.importorskip("pty", reason="Windows has no pseudo-terminals")
from tests.cli.terminal import Terminal
from tests.leader.emulated_leader import START, EmulatedLeader, EmulatedMotors, write_calibration

SINE = math.radians(6.0), 0.5
"""Amplitude [rad] and frequency [Hz] of the motion: four fifths of the acceleration of axis 3."""

MAX_LAG = 0.15
"""[s] Largest lag of the arm behind the leader."""


@pytest.fixture
def watcher(plain_server: AppServer) -> Iterator[Client]:
    with connect(plain_server.url, "Watcher") as watcher:
        yield watcher
        watcher.clear_stop()
        watcher.ask(requests.ReleaseLease())


class MovedLeader(EmulatedLeader):
    """A leader that rests at START, and moves as a sine from ``begin`` on."""

    def __init__(self) -> None:
        self.begun = math.inf
        super().__init__(self._angles)

    def begin(self) -> None:
        self.begun = time.monotonic()

    def _angles(self, t: float) -> tuple[float, ...]:
        amplitude, frequency = SINE
        wave = amplitude * math.sin(2.0 * math.pi * frequency * max(t - self.begun, 0.0))
        return tuple(angle + wave * (axis in (0, 2, 4)) for axis, angle in enumerate(START))


@pytest.fixture
def leader() -> Iterator[MovedLeader]:
    with MovedLeader() as leader:
        yield leader


@pytest.fixture
def command(plain_server: AppServer, leader: MovedLeader, tmp_path: Path) -> list[str]:
    file = write_calibration(tmp_path / "leader.json")
    options = [leader.port, "--calibration", str(file), "--url", plain_server.url]
    return [sys.executable, "-m", "katana450", "leader", *options]


@contextmanager
def at_terminal(command: list[str]) -> Iterator[Terminal]:
    shown = Terminal(*command)
    try:
        yield shown
    finally:
        shown.close()


def posture(watcher: Client, tmp_path: Path, angles: tuple[float, ...]) -> np.ndarray:
    """Return the posture of the arm at ``angles`` of the motors."""
    calibration = decoded_calibration((tmp_path / "leader.json").read_bytes())
    joints = JointMap(calibration, watcher.query(answers.Arm))
    motors = EmulatedMotors()
    motors.place(angles)
    ticks = {motor: motors.motors[motor - 1][FEETECH.position] for motor in joints.motors}
    return joints.posture(ticks).q


def at_rest(watcher: Client) -> bool:
    return not watcher.query(answers.State).moving


def stays(watcher: Client, seconds: float) -> bool:
    """Return whether the arm does not move for ``seconds``."""
    before = watcher.query(answers.State).setpoint
    time.sleep(seconds)
    return watcher.query(answers.State).setpoint == before


def lag(t: np.ndarray, wave: np.ndarray, q: np.ndarray) -> float:
    """Return the delay [s] at which ``q`` correlates best with ``wave``, both at ``t``."""
    delays = np.arange(0.0, 0.5, 1e-3)
    end = t[-1] - delays[-1]
    grid = np.arange(t[0] + delays[-1], end, 5e-3)
    reference = np.interp(grid, t, wave)
    scores = [np.corrcoef(reference, np.interp(grid + delay, t, q))[0, 1] for delay in delays]
    return float(delays[int(np.argmax(scores))])


def test_stop_and_unplugging_end_it_until_a_person_presses_enter(
    watcher: Client, leader: MovedLeader, command: list[str], tmp_path: Path
) -> None:
    with at_terminal(command) as shown:
        shown.wait_for("moves to the posture of the leader")
        shown.wait_for("The arm follows the leader.")
        goal = posture(watcher, tmp_path, START)
        assert np.abs(np.array(watcher.query(answers.State).setpoint) - goal).max() < 0.01
        assert not any(leader.motors.torque)
        leader.begin()
        until(lambda: not at_rest(watcher))
        watcher.stop()
        shown.wait_for("The arm was stopped")
        shown.wait_for("Press Enter to begin again.")
        watcher.clear_stop()
        watcher.ask(requests.ReleaseLease())
        # The leader moves on, and the arm does not.
        assert stays(watcher, 0.5)
        leader.begun = math.inf
        shown.type("\n")
        shown.wait_for("The arm follows the leader.")
        leader.begin()
        until(lambda: not at_rest(watcher))
        leader.unplug()
        shown.wait_for("is lost")
        assert shown.process.wait(10.0) == 1
        # The arm brakes, and the lease of those who leave is kept for a moment.
        until(lambda: at_rest(watcher))
        until(lambda: watcher.query(answers.State).holder is None)


@pytest.mark.long
def test_lag_behind_a_sine(
    watcher: Client, leader: MovedLeader, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with at_terminal(command) as shown:
        shown.wait_for("The arm follows the leader.")
        leader.begin()
        time.sleep(2.0)
        rows: list[tuple[float, float, list[float]]] = []
        for state in watcher.states(50.0):
            now = time.monotonic()
            rows.append((now, leader.motors.motion(now)[0], state.setpoint))
            if now > leader.begun + 12.0:
                break
        shown.process.send_signal(signal.SIGINT)
        shown.process.wait(10.0)
    t, wave, q = (np.array(column) for column in zip(*rows, strict=True))
    lags = [lag(t, sign * wave, q[:, axis]) for axis, sign in ((0, -1), (2, 1), (4, -1))]
    # The arm overshoots where the processes got no time for a moment, so most periods count.
    period = np.floor((t - t[0]) * SINE[1])
    amplitudes = [np.ptp(q[period == number, 0]) for number in range(5)]
    amplitude = float(np.median(amplitudes) / np.ptp(wave))
    with capsys.disabled():
        print(f"\nlag {1e3 * max(lags):.0f} ms, amplitude {amplitude:.1%}")
    assert max(lags) < MAX_LAG
    assert amplitude == pytest.approx(1.0, abs=0.05)
