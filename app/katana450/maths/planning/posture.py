"""Kinematics on jets: the tool point, and the joints of one branch, with their derivatives.

The closed form of maths/kinematics/solver.py runs on Taylor series: exact, with derivatives.
Lengths in m, angles in rad.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import FiveAxisArm
from katana450.maths.kinematics.branch import Branch, Shoulder
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.solver import closed_form
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import JETS, Jet, atan2, sin_cos, sqrt

FiveJets = tuple[Jet, Jet, Jet, Jet, Jet]
JointJets = tuple[Jet, ...]
ThreeJets = tuple[Jet, Jet, Jet]


class ToolJets(NamedTuple):
    """The tool on a curve as jets, in the freedoms of a `ToolTarget`.

    Attributes:
        x, y, z: the tool point in {S} [m].
        pitch, roll: the orientation of a five-axis arm of the family [rad].
        columns: those of the rotation of the tool; None if pitch and roll count.
    """

    x: Jet
    y: Jet
    z: Jet
    pitch: Jet
    roll: Jet
    columns: tuple[ThreeJets, ThreeJets, ThreeJets] | None = None

    @staticmethod
    def turned(point: ThreeJets, columns: tuple[ThreeJets, ThreeJets, ThreeJets]) -> ToolJets:
        """Return the tool at ``point`` with the rotation of these columns."""
        return ToolJets(*point, Jet.constant(0.0), Jet.constant(0.0), columns)

    @property
    def T(self) -> FloatArray:
        """The poses (N, 4, 4) at N places, or at one, of a tool with a rotation."""
        assert self.columns is not None
        numbers = [*(entry for column in self.columns for entry in column), *self[:3]]
        rows = np.stack(np.broadcast_arrays(*(np.atleast_1d(jet.c0) for jet in numbers)), axis=1)
        T = np.zeros((len(rows), 4, 4))
        T[:, :3] = rows.reshape(-1, 4, 3).swapaxes(1, 2)
        T[:, 3, 3] = 1.0
        return T

    @property
    def target(self) -> ToolTarget:
        """The target at one place."""
        if self.columns is not None:
            return ToolTarget.of(self.T[0])
        *point, pitch, roll = (float(np.asarray(jet.c0)) for jet in self[:5])
        return ToolTarget(frozen(point), pitch, roll)


def point_by_exponentials(chain: Chain, q: JointJets) -> ThreeJets:
    """Return the tool point [m] in {S} of any chain at the joint angles `q` [rad].

    The product of exponentials acts on the point from the tool to the base: a turn by q about
    (omega, v) moves p by sin q (omega x p + v) + (1 - cos q) omega x (omega x p + v). A joint that
    slides moves it by q v.
    """
    x, y, z = (Jet.constant(float(coordinate)) for coordinate in chain.M[:3, 3])
    joints = zip(q[::-1], chain.S.T[::-1].tolist(), chain.slides[::-1], strict=True)
    for angle, (wx, wy, wz, vx, vy, vz), slides in joints:
        s, c = sin_cos(angle)
        s = angle if slides else s
        ax, ay, az = wy * z - wz * y + vx, wz * x - wx * z + vy, wx * y - wy * x + vz
        x = x + s * ax + (1.0 - c) * (wy * az - wz * ay)
        y = y + s * ay + (1.0 - c) * (wz * ax - wx * az)
        z = z + s * az + (1.0 - c) * (wx * ay - wy * ax)
    return x, y, z


def beside(arm: FiveAxisArm, sp: Jet, cp: Jet, sr: Jet, cr: Jet) -> ThreeJets:
    """Return the tool point relative to {K}, as `FiveAxisArm.beside`: outward, sideways, up."""
    x, y, z = arm.T_K_tool[:3, 3].tolist()
    y, z = cr * y - sr * z, sr * y + cr * z
    return cp * x + sp * z, y, cp * z - sp * x


def facing(
    arm: FiveAxisArm, shoulder: Shoulder, x: Jet, y: Jet, z: Jet, aside: Jet | float = 0.0
) -> ThreeJets:
    """Return (alpha1, u, height) of the arm's plane that holds the point (x, y, z) of {S}.

    `aside` is the sideways offset of the point from {K} in the plane [m]. u is the distance of the
    point outward from axis 1 [m], NaN where no plane holds it. height is its distance above the
    shoulder [m].
    """
    (r11, r12, r13, p1), (r21, r22, r23, p2), (r31, r32, r33, p3), _ = arm.T_C_S.tolist()
    if not arm.is_canonical:
        x, y, z = (
            r11 * x + r12 * y + r13 * z + p1,
            r21 * x + r22 * y + r23 * z + p2,
            r31 * x + r32 * y + r33 * z + p3,
        )
    side = arm.d + aside
    outward = sqrt(x * x + y * y - side * side)
    u = outward if shoulder == "front" else -outward
    return atan2(y * u - x * side, x * u + y * side), u, z


def posture(
    arm: FiveAxisArm, branch: Branch, x: Jet, y: Jet, z: Jet, pitch: Jet, roll: Jet
) -> FiveJets:
    """Return the canonical angles on `branch` with the tool point at (x, y, z) of {S}.

    The angles may differ by whole turns from those inside limits. Out of reach they are NaN.
    """
    sp, cp = sin_cos(pitch)
    sr, cr = sin_cos(roll)
    outward: Jet | float
    outward, sideways, up = beside(arm, sp, cp, sr, cr) if arm.off_axis else (0.0, 0.0, 0.0)
    alpha1, u, height = facing(arm, branch.shoulder, x, y, z, sideways)
    # {K} in its own plane: there alpha1 is 0.
    rows = (
        (cp, sp * sr, sp * cr, u - outward),
        (Jet.constant(0.0), cr, -sr, Jet.constant(arm.d)),
        (-sp, cp * sr, cp * cr, height - up),
        (0.0, 0.0, 0.0, 1.0),
    )
    _, elbow_up, elbow_down, bend, _ = closed_form(arm, JETS)(1.0, 0.0, u - outward, rows)
    two, three = (elbow_up, bend) if branch.elbow == "up" else (elbow_down, -bend)
    # The given pitch and roll have kept their turns.
    return alpha1, two, three, (pitch + arm.tilt) - two - three, roll
