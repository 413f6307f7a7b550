"""The torques that hold the arm of the file up agree with its energy and with MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from katana450.arm.robot.bare import bare
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.weight import loads_of
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import joint_frames
from katana450.maths.kinematics.statics import GRAVITY, LinkLoad, holding_torques
from katana450.resources import URDF_PATH


def energy(robot: Robot, q: FloatArray) -> float:
    """Return the potential energy [J] of the weight, from the position of each mass."""
    moved = (np.eye(4), *joint_frames(robot.require_arm().chain, q))
    return sum(
        GRAVITY * load.mass * float((moved[load.axes] @ [*load.centre, 1.0])[2])
        for load in loads_of(robot)
    )


@pytest.mark.parametrize("seed", range(5))
def test_torques_are_the_slope_of_the_energy(robot: Robot, arm: MountedArm, seed: int) -> None:
    chain = arm.chain
    q = np.random.default_rng(seed).uniform(chain.lower, chain.upper)
    step = 1e-5
    slope = [
        (energy(robot, q + step * e) - energy(robot, q - step * e)) / (2.0 * step)
        for e in np.eye(chain.n)
    ]
    np.testing.assert_allclose(holding_torques(chain, q, loads_of(robot)), slope, rtol=0, atol=1e-8)


def test_mujoco_finds_the_same_from_the_file(robot: Robot, arm: MountedArm) -> None:
    peer = mujoco.MjModel.from_xml_path(str(URDF_PATH))
    peer.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
    data = mujoco.MjData(peer)
    chain, random = arm.chain, np.random.default_rng(450)
    for _ in range(10):
        q = random.uniform(chain.lower, chain.upper)
        for name, angle in zip(chain.names, q, strict=True):
            data.joint(name).qpos[0] = angle
        mujoco.mj_forward(peer, data)
        wanted = [float(data.joint(name).qfrc_bias[0]) for name in chain.names]
        np.testing.assert_allclose(
            holding_torques(chain, q, loads_of(robot)), wanted, rtol=0, atol=1e-6
        )


def test_vertical_arm_needs_torque_for_the_gripper_only(robot: Robot, arm: MountedArm) -> None:
    chain = arm.chain
    upright = holding_torques(chain, np.deg2rad((30.0, -90.0, 0.0, 0.0, 0.0)), loads_of(robot))
    stretched = holding_torques(chain, np.zeros(chain.n), loads_of(robot))
    # Axis 1 is vertical. A shoulder that holds the arm out pulls up, towards negative angles.
    assert abs(stretched[0]) < 1e-12
    assert stretched[1] < -5.0
    assert abs(upright[1]) < 0.1 * abs(stretched[1])
    without = holding_torques(chain, np.zeros(chain.n), loads_of(bare(robot)))
    assert abs(without[1]) < abs(stretched[1]) - 0.5
    total = sum(load.mass for load in loads_of(robot) if load.axes)
    assert 0.0 < total < 4.8


def test_mass_of_the_base_needs_no_torque(robot: Robot, arm: MountedArm) -> None:
    chain = arm.chain
    base = LinkLoad(0, 100.0, np.array((1.0, 1.0, 1.0)))
    assert not holding_torques(chain, np.zeros(chain.n), [base]).any()
    with pytest.raises(InputError):
        holding_torques(chain, np.full(chain.n, np.nan), loads_of(robot))
