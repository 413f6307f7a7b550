"""The survey of any arm, as fine as its kinematics can be evaluated in some minutes."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.swivel import SevenAxes
from katana450.extensions.reachability.map import Survey
from katana450.extensions.reachability.pose_reachability import PoseReachability
from katana450.extensions.reachability.reachability import Reachability
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import FiveAxisKinematics, Kinematics

VOXEL, PITCHES, ROLLS = 0.02, 36, 24
"""Defaults of five-axis arms: edge of a voxel [m], and numbers of steps."""

ROUND: Final = 0.005
"""[m] The edge of a voxel of other arms is a multiple of this."""


class Fineness(NamedTuple):
    """The fineness of the map of an arm: its defaults, and its maximum.

    Attributes:
        voxels: number of voxels from the middle of the reach to its end.
        pitches, rolls: numbers of steps.
        poses: maximum number of poses in the box around the reach.
    """

    voxels: int
    pitches: int
    rolls: int
    poses: int


CLOSED: Final = Fineness(16, 24, 6, 100_000_000)
PLANE: Final = Fineness(20, 36, 1, 100_000_000)
SWIVEL: Final = Fineness(10, 12, 4, 10_000_000)
SEARCHED: Final = Fineness(5, 8, 2, 200_000)
POINTS: Final = Fineness(10, 1, 1, 200_000)


class MapOptions(NamedTuple):
    """Values that decide what is mapped; None for what suits the arm.

    Attributes:
        table: height of the table in the base frame [m].
        voxel: edge of a voxel [m].
        pitches, rolls: numbers of steps of the orientation.
    """

    table: float = 0.0
    voxel: float | None = None
    pitches: int | None = None
    rolls: int | None = None


def survey_of(
    chain: Chain, T_base_shoulder: FloatArray, home: FloatArray, options: MapOptions
) -> Survey:
    """Return the survey of the arm ``chain``.

    Args:
        chain: the arm with its tool, in {S}.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        home: (n,) joint angles of Home [rad].
        options: what is mapped.

    Raises:
        InputError: a value is out of range, or the map would take too long.
        RobotDescriptionError: axis 1 of a five-axis arm is not upright.
    """
    table, voxel, pitches, rolls = options
    kinematics = kinematics_of(chain)
    if isinstance(kinematics, FiveAxisKinematics):
        steps = PITCHES if pitches is None else pitches, ROLLS if rolls is None else rolls
        reach = Reachability(chain, T_base_shoulder, table, *steps)
        return Survey(reach, VOXEL if voxel is None else voxel)
    fineness = _fineness(kinematics)
    reachability = PoseReachability(
        chain,
        T_base_shoulder,
        table,
        fineness.pitches if pitches is None else pitches,
        fineness.rolls if rolls is None else rolls,
        home,
    )
    if voxel is None:
        voxel = ROUND * math.ceil(reachability.reach / fineness.voxels / ROUND)
    survey = Survey(reachability, voxel)
    poses = len(survey.grid) * reachability.orientations
    if poses > fineness.poses:
        raise InputError(
            f"The map would take {poses:.2g} poses, and at most {fineness.poses:.0e} are tried for "
            f"this arm ({kinematics.method}). Choose larger voxels than {1e3 * voxel:g} mm, or "
            "fewer pitches and rolls."
        )
    return survey


def _fineness(kinematics: Kinematics) -> Fineness:
    if isinstance(kinematics, ClosedForm):
        return CLOSED if kinematics.chain.n == 6 else PLANE
    if isinstance(kinematics, SevenAxes):
        return SWIVEL
    return SEARCHED if kinematics.chain.n >= 6 else POINTS
