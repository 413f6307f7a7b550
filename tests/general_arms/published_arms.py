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


# Universal Robots, DH parameters for calculations of kinematics and dynamics.
UR5E = craig(
    [
        (0.0, 0.0, 0.1625, 0.0),
        (QUARTER, 0.0, 0.0, 0.0),
        (0.0, -0.425, 0.0, 0.0),
        (0.0, -0.3922, 0.1333, 0.0),
        (QUARTER, 0.0, 0.0997, 0.0),
        (-QUARTER, 0.0, 0.0996, 0.0),
    ],
    degrees(*[-360.0] * 6),
    degrees(*[360.0] * 6),
)

WRITTEN = 1.570796327
"""A right angle as Universal Robots writes it."""

# The same with the digits of ur_description, default_kinematics of the UR5e.
UR5E_FILE = craig(
    [
        (0.0, 0.0, 0.1625, 0.0),
        (WRITTEN, 0.0, 0.0, 0.0),
        (0.0, -0.425, 0.0, 0.0),
        (0.0, -0.3922, 0.1333, 0.0),
        (WRITTEN, 0.0, 0.0997, 0.0),
        (-QUARTER, 0.0, 0.0996, 0.0),
    ],
    degrees(*[-360.0] * 6),
    degrees(*[360.0] * 6),
)

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
