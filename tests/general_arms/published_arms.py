"""Commercial arms from their published dimensions, with their limits, without code of the app.

The rows are those of Craig's convention, as the makers and Corke's tables print them: twist and
length of the link before the joint, then the offset along its axis and its angle at zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

QUARTER = math.pi / 2.0
Row = tuple[float, float, float, float]

TOOL = se3.from_rotation_translation(so3.from_rpy(0.3, -0.4, 0.5), np.array([0.05, 0.02, 0.11]))
"""A tool that is neither on the last axis nor along it."""


def craig(
    rows: Sequence[Row],
    lower: Sequence[float],
    upper: Sequence[float],
    tool: FloatArray = TOOL,
) -> Chain:
    """Return the chain of rows (twist, length, offset, angle) [rad, m] with limits [rad]."""
    T = np.eye(4)
    S = []
    for twist, length, offset, angle in rows:
        T = T @ se3.from_rotation_translation(so3.rotation_x(twist), np.array([length, 0.0, 0.0]))
        T = T @ se3.from_rotation_translation(so3.rotation_z(angle), np.array([0.0, 0.0, 0.0]))
        T[:3, 3] += offset * T[:3, 2]
        S.append(screws.revolute(T[:3, 2], T[:3, 3]))
    return Chain(
        M=T @ tool,
        S=np.column_stack(S),
        lower=np.array(lower),
        upper=np.array(upper),
        speed=np.ones(len(rows)),
        names=tuple(f"joint{number + 1}" for number in range(len(rows))),
    )


def degrees(*ends: float) -> list[float]:
    return [math.radians(end) for end in ends]


def ur5e(quarter: float = QUARTER, twist_4: float = 0.0, length_6: float = 0.0) -> Chain:
    """Return a UR5e by the DH parameters of Universal Robots, or one that is off by a little.

    Args:
        quarter: twists of links 2 and 5 [rad]; that of link 6 is exact, as in their file.
        twist_4: twist of link 4, between two parallel axes [rad].
        length_6: length of link 6, between two axes that meet [m].
    """
    return craig(
        [
            (0.0, 0.0, 0.1625, 0.0),
            (quarter, 0.0, 0.0, 0.0),
            (0.0, -0.425, 0.0, 0.0),
            (twist_4, -0.3922, 0.1333, 0.0),
            (quarter, 0.0, 0.0997, 0.0),
            (-QUARTER, length_6, 0.0996, 0.0),
        ],
        degrees(*[-360.0] * 6),
        degrees(*[360.0] * 6),
    )


UR5E = ur5e()

WRITTEN = 1.570796327
"""A right angle as Universal Robots writes it."""

# The same with the digits of ur_description, default_kinematics of the UR5e.
UR5E_FILE = ur5e(WRITTEN)

# Armstrong, Khatib & Burdick (1986).
PUMA_560 = craig(
    [
        (0.0, 0.0, 0.0, 0.0),
        (-QUARTER, 0.0, 0.2435, 0.0),
        (0.0, 0.4318, -0.0934, 0.0),
        (QUARTER, -0.0203, 0.4331, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
    ],
    degrees(-160.0, -225.0, -45.0, -110.0, -100.0, -266.0),
    degrees(160.0, 45.0, 225.0, 170.0, 100.0, 266.0),
)

# KUKA, KR 6 R900 sixx: data sheet.
KR_6 = craig(
    [
        (0.0, 0.0, 0.4, 0.0),
        (-QUARTER, 0.025, 0.0, 0.0),
        (0.0, 0.455, 0.0, -QUARTER),
        (-QUARTER, 0.035, 0.42, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (-QUARTER, 0.0, 0.08, 0.0),
    ],
    degrees(-170.0, -190.0, -120.0, -185.0, -120.0, -350.0),
    degrees(170.0, 45.0, 156.0, 185.0, 120.0, 350.0),
)

LEVEL = se3.from_rotation_translation(
    so3.from_rpy(-QUARTER, 0.0, 0.0), np.array([0.1291, 0.0, 0.0])
)
"""A tool point in the plane of the arm."""

# Trossen Robotics, PincherX 100: joints of its description.
PINCHERX_100 = craig(
    [
        (0.0, 0.0, 0.0931, 0.0),
        (-QUARTER, 0.0, 0.0, -math.atan2(0.1, 0.035)),
        (0.0, math.hypot(0.1, 0.035), 0.0, math.atan2(0.1, 0.035)),
        (0.0, 0.1, 0.0, 0.0),
    ],
    degrees(-180.0, -111.0, -121.0, -100.0),
    degrees(180.0, 107.0, 92.0, 123.0),
    LEVEL,
)

# ROBOTIS, OpenMANIPULATOR-X: joints of its description.
OPENMANIPULATOR_X = craig(
    [
        (0.0, 0.012, 0.0595, 0.0),
        (-QUARTER, 0.0, 0.0, -math.atan2(0.128, 0.024)),
        (0.0, math.hypot(0.128, 0.024), 0.0, math.atan2(0.128, 0.024)),
        (0.0, 0.124, 0.0, 0.0),
    ],
    [-math.pi, -1.5, -1.5, -1.7],
    [math.pi, 1.5, 1.4, 1.97],
    LEVEL,
)

# Franka Robotics, Denavit-Hartenberg parameters and limits of the Panda.
PANDA = craig(
    [
        (0.0, 0.0, 0.333, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.316, 0.0),
        (QUARTER, 0.0825, 0.0, 0.0),
        (-QUARTER, -0.0825, 0.384, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.088, 0.107, 0.0),
    ],
    [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
    [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
)

# KUKA, LBR iiwa 7 R800: data sheet.
IIWA_7 = craig(
    [
        (0.0, 0.0, 0.34, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.4, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (-QUARTER, 0.0, 0.4, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.126, 0.0),
    ],
    degrees(-170.0, -120.0, -170.0, -120.0, -170.0, -120.0, -175.0),
    degrees(170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 175.0),
)

# Six axes with a twist in every link, and seven whose axes meet nowhere: no closed form.
SKEWED_LINKS = [
    (0.0, 0.0, 0.3, 0.1),
    (1.2, 0.05, 0.1, 0.0),
    (0.7, 0.3, -0.09, 0.0),
    (0.9, -0.02, 0.4, 0.0),
    (-1.0, 0.03, 0.1, 0.0),
    (0.7, 0.05, 0.06, 0.0),
    (1.2, 0.05, 0.1, 0.0),
]
SKEWED_6 = craig(
    SKEWED_LINKS[:6],
    [-2.8] * 6,
    [2.8] * 6,
)
SKEWED_7 = craig(
    SKEWED_LINKS,
    [-2.0] * 7,
    [2.0] * 7,
)

# The twists of these are no quarter turns, as those of some cobots.
SLANTED_WRIST = craig(
    [
        (0.0, 0.0, 0.0, 0.0),
        (1.2, 0.05, 0.2435, 0.0),
        (0.0, 0.4318, -0.0934, 0.0),
        (0.9, -0.0203, 0.4331, 0.0),
        (-1.0, 0.0, 0.0, 0.0),
        (0.7, 0.0, 0.0, 0.0),
    ],
    [-math.pi] * 6,
    [math.pi] * 6,
)
CROSSING_SHOULDER = craig(
    [
        (0.0, 0.0, 0.3, 0.1),
        (1.2, 0.0, 0.1, 0.0),
        (0.7, 0.3, -0.09, 0.0),
        (0.9, -0.02, 0.4, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
    ],
    [-math.pi] * 6,
    [math.pi] * 6,
)
SLANTED_PARALLEL = craig(
    [
        (0.0, 0.0, 0.1625, 0.0),
        (1.1, 0.02, 0.0, 0.0),
        (0.0, -0.425, 0.0, 0.0),
        (math.pi, -0.3922, 0.1333, 0.0),
        (1.2, 0.01, 0.0997, 0.0),
        (-0.8, 0.0, 0.0996, 0.0),
    ],
    [-math.pi] * 6,
    [math.pi] * 6,
)

# UFACTORY, kinematic parameters of the 850: a spherical wrist.
UF_850 = craig(
    [
        (0.0, 0.0, 0.364, 0.0),
        (QUARTER, 0.0, 0.0, QUARTER),
        (math.pi, 0.39, 0.0, QUARTER),
        (-QUARTER, 0.15, 0.426, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.09, 0.0),
    ],
    degrees(-360.0, -132.0, -242.0, -360.0, -124.0, -360.0),
    degrees(360.0, 132.0, 3.5, 360.0, 124.0, 360.0),
)

# ABB, CRB 15000-5/0.95 (GoFa): joints and limits of the description by ROS-Industrial.
GOFA_5 = craig(
    [
        (0.0, 0.0, 0.265, 0.0),
        (-QUARTER, 0.0, 0.0, -QUARTER),
        (0.0, 0.444, 0.0, 0.0),
        (-QUARTER, 0.110, 0.470, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (-QUARTER, 0.080, 0.101, 0.0),
    ],
    degrees(-180.0, -180.0, -225.0, -180.0, -180.0, -180.0),
    degrees(180.0, 180.0, 85.0, 180.0, 180.0, 180.0),
)

# FANUC, CRX-10iA: Abbes & Poisson, Geometric approach for inverse kinematics of the FANUC CRX
# collaborative robot, Robotics 13 (2024), which also shows poses with 12 and 16 postures.
CRX_10IA = craig(
    [
        (0.0, 0.0, 0.0, 0.0),
        (-QUARTER, 0.0, 0.0, -QUARTER),
        (math.pi, 0.540, 0.0, 0.0),
        (-QUARTER, 0.0, -0.540, 0.0),
        (QUARTER, 0.0, 0.150, 0.0),
        (-QUARTER, 0.0, -0.160, 0.0),
    ],
    [-math.pi] * 6,
    [math.pi] * 6,
)


def kinova(upper: float, fore: float, offset: float, bend: float) -> Chain:
    """Return a Jaco or Mico of Kinova's user guides (DH parameters of the curved wrist).

    Lengths [m] of upper arm and forearm, their offset, and the angle [rad] of the wrist's bends.
    """
    part = 0.0741 * math.sin(0.5 * bend) / math.sin(bend)
    return craig(
        [
            (0.0, 0.0, 0.2755, 0.0),
            (QUARTER, 0.0, 0.0, 0.0),
            (math.pi, upper, -offset, 0.0),
            (QUARTER, 0.0, -fore - part, 0.0),
            (bend, 0.0, -2.0 * part, 0.0),
            (bend, 0.0, -part - 0.16, 0.0),
        ],
        degrees(-360.0, 47.0, 19.0, -360.0, -360.0, -360.0),
        degrees(360.0, 313.0, 341.0, 360.0, 360.0, 360.0),
    )


JACO_2 = kinova(0.41, 0.2073, 0.0098, math.radians(55.0))
MICO = kinova(0.29, 0.1233, 0.007, math.radians(60.0))


def irb_140(between_4_and_5: float, between_5_and_6: float) -> Chain:
    """Return an ABB IRB 140 (data sheet) whose wrist has offsets [m] that the real one lacks."""
    return craig(
        [
            (0.0, 0.0, 0.352, 0.0),
            (-QUARTER, 0.07, 0.0, -QUARTER),
            (0.0, 0.36, 0.0, 0.0),
            (-QUARTER, 0.0, 0.38, 0.0),
            (QUARTER, between_4_and_5, 0.0, 0.0),
            (-QUARTER, between_5_and_6, 0.065, 0.0),
        ],
        degrees(-180.0, -90.0, -230.0, -200.0, -115.0, -400.0),
        degrees(180.0, 110.0, 50.0, 200.0, 115.0, 400.0),
    )


# Kinova, Gen3 with seven axes: joints of its description. The wrist misses by 0.35 mm.
GEN3_7 = craig(
    [
        (0.0, 0.0, 0.28481, 0.0),
        (QUARTER, 0.0, -0.01175, 0.0),
        (-QUARTER, 0.0, 0.42076, 0.0),
        (QUARTER, 0.0, -0.01275, 0.0),
        (-QUARTER, 0.0, 0.31436, 0.0),
        (QUARTER, 0.0, -0.00035, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
    ],
    [-math.pi, -2.41, -math.pi, -2.66, -math.pi, -2.23, -math.pi],
    [math.pi, 2.41, math.pi, 2.66, math.pi, 2.23, math.pi],
)

# Kinova, Gen3 lite: joints and limits of its description.
GEN3_LITE = craig(
    [
        (0.0, 0.0, 0.2433, 0.0),
        (QUARTER, 0.0, 0.03, QUARTER),
        (math.pi, 0.28, 0.02, QUARTER),
        (QUARTER, 0.0, 0.245, QUARTER),
        (QUARTER, 0.0, 0.057, 0.0),
        (-QUARTER, 0.0, 0.235, -QUARTER),
    ],
    [-2.76] * 6,
    [2.76] * 6,
)

FOUR = {"PincherX-100": PINCHERX_100, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}
SIX = {
    "UR5e": UR5E,
    "Puma 560": PUMA_560,
    "KR 6": KR_6,
    "slanted wrist": SLANTED_WRIST,
    "crossing shoulder": CROSSING_SHOULDER,
    "slanted parallel axes": SLANTED_PARALLEL,
}
SEVEN = {"Panda": PANDA, "iiwa": IIWA_7}
NEAR_MISS = {"Gen3": GEN3_7}
SKEWED = {"skewed 6": SKEWED_6, "skewed 7": SKEWED_7}

# UFACTORY, xArm6 and xArm7: joints of their descriptions. Axes 1, 4 and 6, or every second axis,
# turn twice.
_BENT = math.atan2(0.2845, 0.053)
XARM_6 = craig(
    [
        (0.0, 0.0, 0.267, 0.0),
        (-QUARTER, 0.0, 0.0, -_BENT),
        (0.0, math.hypot(0.2845, 0.053), 0.0, _BENT),
        (-QUARTER, 0.0775, 0.3425, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (-QUARTER, 0.076, 0.097, 0.0),
    ],
    [-math.tau, -2.059, -3.927, -math.tau, -1.69297, -math.tau],
    [math.tau, 2.0944, 0.19198, math.tau, math.pi, math.tau],
)
XARM_7 = craig(
    [
        (0.0, 0.0, 0.267, 0.0),
        (-QUARTER, 0.0, 0.0, 0.0),
        (QUARTER, 0.0, 0.293, 0.0),
        (QUARTER, 0.0525, 0.0, 0.0),
        (QUARTER, 0.0775, 0.3425, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (-QUARTER, 0.076, 0.097, 0.0),
    ],
    [-math.tau, -2.059, -math.tau, -0.19198, -math.tau, -1.69297, -math.tau],
    [math.tau, 2.0944, math.tau, 3.927, math.tau, math.pi, math.tau],
)

OFFSET = {
    "xArm 6": XARM_6,
    "GoFa": GOFA_5,
    "CRX-10iA": CRX_10IA,
    "Jaco": JACO_2,
    "Mico": MICO,
    "Gen3 lite": GEN3_LITE,
    "IRB 140, 20 mm between 4 and 5": irb_140(0.02, 0.0),
    "IRB 140, 20 mm between 5 and 6": irb_140(0.0, 0.02),
    "IRB 140, 0.3 mm between 5 and 6": irb_140(0.0, 3e-4),
}
"""Six axes whose wrists have an offset."""
