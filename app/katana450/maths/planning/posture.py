"""Forward kinematics on jets: the tool point with its derivatives. Lengths in m, angles in rad."""

from __future__ import annotations

from katana450.maths.kinematics.arm import FiveAxisArm
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet, sin_cos

FiveJets = tuple[Jet, Jet, Jet, Jet, Jet]
JointJets = tuple[Jet, ...]
ThreeJets = tuple[Jet, Jet, Jet]


def tool_point(arm: FiveAxisArm, alpha: FiveJets) -> ThreeJets:
    """Return the tool point in {C} at the canonical angles `alpha`."""
    one, two, three, four, five = alpha
    b = two + three
    phi = b + four
    (s1, c1), (s2, c2), (sb, cb), (sf, cf) = map(sin_cos, (one, two, b, phi))
    u = arm.a + arm.l1 * c2 + arm.l2 * cb + arm.l3 * cf
    v: Jet | float = arm.d
    z = -(arm.l1 * s2 + arm.l2 * sb + arm.l3 * sf)
    if arm.off_axis:
        outward, sideways, up = beside(arm, *sin_cos(phi - arm.tilt), *sin_cos(five))
        u, v, z = u + outward, sideways + arm.d, z + up
    return c1 * u - s1 * v, s1 * u + c1 * v, z


def point_by_exponentials(chain: Chain, q: JointJets) -> ThreeJets:
    """Return the tool point [m] in {S} of any chain at the joint angles `q` [rad].

    The product of exponentials acts on the point from the tool to the base: a turn by q about
    (omega, v) moves p by sin q (omega x p + v) + (1 - cos q) omega x (omega x p + v).
    """
    x, y, z = (Jet.constant(float(each)) for each in chain.M[:3, 3])
    for angle, (wx, wy, wz, vx, vy, vz) in zip(q[::-1], chain.S.T[::-1].tolist(), strict=True):
        s, c = sin_cos(angle)
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
