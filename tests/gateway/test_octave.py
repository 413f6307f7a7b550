"""The real GNU Octave drives the arm over the TCP port, with kinematics of its own."""

from __future__ import annotations

import json
import math
import re
import subprocess

import numpy as np
import pytest

from app.kinematics.inverse import inverse
from app.kinematics.tool import ToolTarget
from app.robot.model import RobotModel
from tests.browser.server import APP, ROOT, AppServer
from tests.gateway import octave

OCTAVE = octave.find()


@pytest.mark.skipif(OCTAVE is None, reason=octave.MISSING)
def test_octave_goes_round_the_papers_circle(model: RobotModel) -> None:
    assert OCTAVE is not None
    with AppServer((*APP, "--lines", "0")) as server:
        found = re.search(r"JSON lines on 127\.0\.0\.1:(\d+)", server.output)
        assert found is not None
        command = [OCTAVE, "--quiet", "--path", str(ROOT / "examples" / "octave")]
        done = subprocess.run(
            [*command, "--eval", f"port = {found[1]}; circle"],
            capture_output=True,
            text=True,
            timeout=90,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[0])
    # Where both have the tip at the start, each by its own kinematics.
    assert told["start_error_mm"] < 1e-11
    chain = model.arm.chain_to("tcp")
    for angle, asked in zip(told["angles"], told["asked"], strict=True):
        p = np.array((0.150, 0.100 * math.sin(angle), -0.110 + 0.100 * math.cos(angle)))
        target = ToolTarget(p, math.radians(75.0 - 13.0 * math.cos(angle)), 0.0)
        T = target.pose(chain, math.atan2(p[1], p[0]))
        nearest = min(np.abs(each.q - asked).max() for each in inverse(chain, T))
        assert nearest < 1e-9
    # How many states there are, and how far the arm lags behind the stream, is the machine's.
    assert told["states"] > 20
    assert told["largest_error_mm"] < 100.0
