"""The nearest pose by a slow, approximate search without closed forms."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain

Mask = npt.NDArray[np.bool_]


def tool_points(lengths: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return tool points (k, 3) and radial coordinates (k,) of joint angles (k, >= 4).

    Computed by trigonometry.
    """
    a = q[:, 1]
    b = a + q[:, 2]
    c = b + q[:, 3]
    l1, l2, l3 = lengths
    r = l1 * np.cos(a) + l2 * np.cos(b) + l3 * np.cos(c)
    z = -l1 * np.sin(a) - l2 * np.sin(b) - l3 * np.sin(c)
    return np.stack((r * np.cos(q[:, 0]), r * np.sin(q[:, 0]), z), axis=1), r


def on_branch(branch: Branch | None, r: FloatArray, theta3: FloatArray) -> Mask:
    if branch is None:
        return np.ones(r.shape, dtype=np.bool_)
    shoulder = r >= 0.0 if branch.shoulder == "front" else r <= 0.0
    elbow = theta3 >= 0.0 if branch.elbow == "up" else theta3 <= 0.0
    return np.asarray(shoulder & elbow)


class NearestPoint:
    """The minimum distance between the tool point inside the limits and a target."""

    STARTS, SAMPLES, ROUNDS = 12, 48, 160

    def __init__(self, chain: Chain, lengths: FloatArray, steps: int) -> None:
        self.lower, self.upper = chain.lower[:4], chain.upper[:4]
        self.lengths = lengths
        axes = [np.linspace(a, b, steps) for a, b in zip(self.lower, self.upper, strict=True)]
        self.grid = np.stack([g.ravel() for g in np.meshgrid(*axes, indexing="ij")], axis=1)
        self.points, self.r = tool_points(lengths, self.grid)

    def distance(self, target: FloatArray, branch: Branch | None, seed: int) -> float:
        """Return the minimum distance [m] that a shrinking random search finds.

        It starts from the best grid points.
        """
        rng = np.random.default_rng(seed)
        d = np.linalg.norm(self.points - target, axis=1)
        d[~on_branch(branch, self.r, self.grid[:, 2])] = np.inf
        start = np.argpartition(d, self.STARTS)[: self.STARTS]
        best, least = self.grid[start], d[start]
        width = np.full(self.STARTS, 0.2)
        rows = np.arange(self.STARTS)
        for _ in range(self.ROUNDS):
            step = rng.normal(size=(self.STARTS, self.SAMPLES, 4)) * width[:, None, None]
            # Moving few joints at a time keeps the others at their limits.
            step *= rng.random(step.shape) < 0.6
            tried = np.clip(best[:, None] + step, self.lower, self.upper)
            flat = tried.reshape(-1, 4)
            points, r = tool_points(self.lengths, flat)
            d = np.linalg.norm(points - target, axis=1)
            d[~on_branch(branch, r, flat[:, 2])] = np.inf
            d = d.reshape(self.STARTS, self.SAMPLES)
            k = d.argmin(axis=1)
            better = d[rows, k] < least
            best[better] = tried[rows, k][better]
            least = np.where(better, d[rows, k], least)
            width *= np.where(better, 1.3, 0.75)
        return float(least.min())


def least_rotation(
    chain: Chain,
    lengths: FloatArray,
    T: FloatArray,
    point: FloatArray,
    branch: Branch | None,
    theta1s: FloatArray,
) -> float:
    """Return the minimum rotation angle [rad] to `T` found with the tool point at `point`.

    ``theta1s`` are the angles to try. The pitch is scanned in steps of a thousandth of a radian,
    for both elbows by the law of cosines; so is the roll.
    """
    l1, l2, l3 = lengths
    lower, upper = chain.lower, chain.upper
    roll = np.linspace(lower[4], upper[4], 1500)
    least = np.pi
    for theta1 in theta1s:
        r = float(point[0] * np.cos(theta1) + point[1] * np.sin(theta1))
        phi = np.linspace(-np.pi, np.pi, 6284)
        wr, wz = r - l3 * np.cos(phi), point[2] + l3 * np.sin(phi)
        cosine = (wr**2 + wz**2 - l1**2 - l2**2) / (2.0 * l1 * l2)
        reachable = np.abs(cosine) <= 1.0
        bend = np.arccos(np.clip(cosine, -1.0, 1.0))
        for theta3 in (bend, -bend):
            theta2 = np.arctan2(-wz, wr) - np.arctan2(l2 * np.sin(theta3), l1 + l2 * np.cos(theta3))
            theta4 = phi - theta2 - theta3
            fits = reachable & on_branch(branch, np.full(phi.shape, r), theta3)
            for i, theta in ((1, theta2), (2, theta3), (3, theta4)):
                turned = np.arctan2(np.sin(theta), np.cos(theta))
                fits &= (turned >= lower[i]) & (turned <= upper[i])
            if fits.any():
                least = min(least, _over_roll(T[:3, :3], theta1, phi[fits], roll))
    return least


def _over_roll(R: FloatArray, theta1: float, phi: FloatArray, roll: FloatArray) -> float:
    """Return the minimum angle over the grid phi x roll, from the trace of the rotation between."""
    c, s = np.cos(theta1), np.sin(theta1)
    A = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ R
    cf, sf = np.cos(phi)[:, None], np.sin(phi)[:, None]
    cp, sp = np.cos(roll)[None, :], np.sin(roll)[None, :]
    # trace(A^T Ry(phi) Rx(roll)), with the columns of Ry Rx written out.
    trace = (
        (A[0, 0] * cf - A[2, 0] * sf)
        + (A[0, 1] * sf * sp + A[1, 1] * cp + A[2, 1] * cf * sp)
        + (A[0, 2] * sf * cp - A[1, 2] * sp + A[2, 2] * cf * cp)
    )
    return float(np.arccos(np.clip(0.5 * (trace.max() - 1.0), -1.0, 1.0)))
