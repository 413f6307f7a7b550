"""Test GNU Octave, which drives the arm over the TCP port with its own kinematics."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.maths.kinematics.solver import inverse
from katana450.maths.kinematics.tool import ToolTarget
from tests.browser.server import ROOT, AppServer
from tests.commands import completed
from tests.gateway import octave
from tests.gateway.lines import Lines


@pytest.fixture(scope="module")
def octave_path() -> str:
    """Return the path of Octave; skip the tests where it is missing."""
    # Found here and not when this file is read, as it is by each process of `make test`.
    return octave.find() or pytest.skip(octave.MISSING)


def output_of(octave_path: str, server: AppServer, script: str) -> dict[str, Any]:
    """Return the output of a script of examples/octave."""
    command = [octave_path, "--quiet", "--path", str(ROOT / "examples" / "octave")]
    done = completed([*command, "--eval", f"port = {Lines.port(server)}; {script}"], seconds=90)
    assert done.returncode == 0, done.stderr
    output: dict[str, Any] = json.loads(done.stdout.splitlines()[0])
    return output


def check_kinematics(arm: MountedArm, angles: list[float], postures: list[list[float]]) -> None:
    """Compare Octave's joint angles on the circle with ours."""
    chain = arm.chain_to("tcp")
    for angle, q in zip(angles, postures, strict=True):
        p = np.array((0.150, 0.100 * math.sin(angle), -0.110 + 0.100 * math.cos(angle)))
        target = ToolTarget(p, math.radians(75.0 - 13.0 * math.cos(angle)), 0.0)
        T = target.pose(chain, math.atan2(p[1], p[0]))
        assert min(np.abs(solution.q - q).max() for solution in inverse(chain, T)) < 1e-9


@pytest.mark.long
def test_octave_follows_the_circle_of_the_paper(
    arm: MountedArm, server: AppServer, octave_path: str
) -> None:
    output = output_of(octave_path, server, "circle")
    # Both compute the tip at the start, each by its own kinematics.
    assert output["start_error_mm"] < 1e-11
    check_kinematics(arm, output["angles"], output["asked"])
    # The number of states, and the lag of the arm behind the stream, depend on the machine.
    assert output["states"] > 20
    assert output["largest_error_mm"] < 100.0


def test_octave_turns_the_vrml_world_by_name_and_reads_it_back(
    arm: MountedArm, server: AppServer, octave_path: str
) -> None:
    output = output_of(octave_path, server, "places = 6; circle_by_name")
    assert len(output["angles"]) == 6
    check_kinematics(arm, output["angles"], output["asked"])
    np.testing.assert_allclose(output["heard"], output["asked"], rtol=0, atol=1e-9)
