"""Scripts run on real servers of arms with four, six and seven axes: lines, pauses and STOP."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.client import Client, RefusedError, connect
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from tests.browser.server import APP, AppServer
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.published_arms import KR_6, OPENMANIPULATOR_X, PANDA, UR5E

pytestmark = pytest.mark.long

ARMS = {"UR5e": UR5E, "KR 6": KR_6, "Panda": PANDA, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}
SECONDS = 90.0
NEAR = 1e-9
"""[m] Maximum distance of the tool from its line."""


@pytest.fixture(scope="module", params=ARMS)
def chain(request: pytest.FixtureRequest) -> Chain:
    return ARMS[request.param]


@pytest.fixture(scope="module")
def server(chain: Chain, tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(chain_urdf("arm", chain), encoding="utf-8")
    with AppServer((*APP, "--urdf", str(path))) as server:
        yield server


@pytest.fixture
def arm(server: AppServer) -> Iterator[Client]:
    with connect(server.url) as client:
        client.clear_stop()
        client.ask(requests.Home(wait=60))
        yield client
        client.clear_stop()


def state(arm: Client) -> answers.State:
    return arm.query(answers.State)


def pose(now: answers.State) -> FloatArray:
    return np.array(now.T)


def size(chain: Chain) -> float:
    """Return the length [mm] of a line."""
    return 40.0 if chain.n == 4 else 120.0


def script(chain: Chain, start: FloatArray) -> str:
    """Return lines, and a circle round a point beside the tool at ``start`` (4, 4) in {S}."""
    d = size(chain)
    x, y, z = (1e3 * start[:3, 3]).tolist()
    return (
        "name: Lines\nframe: shoulder\nspeed: 0.4\nsteps:\n"
        f"  - line: {{by: {{y: {d}}}}}\n"
        f"  - line: {{by: {{y: {-d}}}}}\n"
        f"  - circle: {{centre: [{x}, {y}, {z - 0.3 * d}], normal: x, radius: {0.3 * d}}}\n"
    )


def planned(arm: Client, text: str) -> None:
    arm.ask(Program(text=text))
    until(arm, lambda now: now.program is not None and now.program.status != "planning")
    now = state(arm).program
    assert now is not None
    assert now.status == "ready", now.why


def until(arm: Client, holds: Callable[[answers.State], bool]) -> answers.State:
    """Return the first state for which ``holds`` is true."""
    end = time.monotonic() + SECONDS
    for now in arm.states(100.0):
        if holds(now):
            return now
        if time.monotonic() > end:
            break
    raise AssertionError(state(arm).program)


def status(now: answers.State) -> str:
    return "" if now.program is None else now.program.status


def on_line(chain: Chain, now: answers.State, start: FloatArray) -> None:
    """Check that the tool is on the line through ``start`` along y, with its orientation."""
    T = pose(now)
    off = T[:3, 3] - start[:3, 3]
    assert abs(off[0]) < NEAR
    assert abs(off[2]) < NEAR
    assert -NEAR < off[1] < 1e-3 * size(chain) + NEAR
    if chain.n >= 6:
        assert so3.angle(T[:3, :3], start[:3, :3]) < 1e-8


def test_tool_is_on_its_line_in_every_state_and_the_circle_closes(
    chain: Chain, arm: Client
) -> None:
    start = pose(state(arm))
    planned(arm, script(chain, start))
    arm.ask(Steer(order=ProgramOrder.RUN))
    seen: dict[int, int] = {}
    for now in arm.states(100.0):
        if status(now) in ("done", "failed", "stopped"):
            break
        assert now.program is not None
        if now.program.step in (1, 2):
            on_line(chain, now, start)
        seen[now.program.step] = seen.get(now.program.step, 0) + 1
    assert status(state(arm)) == "done"
    assert min(seen[1], seen[2], seen[3]) > 20
    # The highest point of the circle is where the lines began.
    np.testing.assert_allclose(pose(state(arm)), start, atol=1e-8)


def test_pause_rests_on_the_line_and_stop_is_continued_to_the_end(
    chain: Chain, arm: Client
) -> None:
    start = pose(state(arm))
    planned(arm, script(chain, start))
    arm.ask(Steer(order=ProgramOrder.RUN))
    middle = 0.4e-3 * size(chain)
    until(arm, lambda now: pose(now)[1, 3] - start[1, 3] > middle)
    arm.ask(Steer(order=ProgramOrder.PAUSE))
    paused = until(arm, lambda now: not now.moving)
    assert status(paused) == "paused"
    on_line(chain, paused, start)
    assert pose(paused)[1, 3] - start[1, 3] < 1e-3 * size(chain) - 1e-3
    arm.ask(Steer(order=ProgramOrder.RESUME))
    until(arm, lambda now: now.program is not None and now.program.step == 3 and now.moving)
    arm.stop()
    stopped = until(arm, lambda now: not now.moving)
    assert stopped.stopped
    assert status(stopped) == "stopped"
    with pytest.raises(RefusedError):
        arm.ask(Steer(order=ProgramOrder.CONTINUE))
    assert np.array_equal(state(arm).q, stopped.q)
    arm.clear_stop()
    arm.ask(Steer(order=ProgramOrder.CONTINUE))
    until(arm, lambda now: status(now) == "done")
    np.testing.assert_allclose(pose(state(arm)), start, atol=1e-8)


def test_file_is_run_at_the_terminal_and_a_long_line_is_refused(
    chain: Chain, server: AppServer, arm: Client, tmp_path: Path
) -> None:
    start = pose(state(arm))
    arm.ask(requests.ReleaseLease())
    path = tmp_path / "lines.yaml"
    path.write_text(script(chain, start), encoding="utf-8")
    command = (sys.executable, "-m", "katana450", "run", str(path), "--url", server.url)
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=SECONDS)
    assert done.returncode == 0, done.stderr
    assert "Done." in done.stdout
    path.write_text("frame: base\nsteps:\n  - line: {by: {x: 1900}}\n", encoding="utf-8")
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=SECONDS)
    assert done.returncode == 1
    assert "% along it, at (" in done.stderr
    assert "mm out of reach" in done.stderr
