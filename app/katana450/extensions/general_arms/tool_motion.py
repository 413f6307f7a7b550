"""Pose and Jacobian of the tool on plain floats, for searches that need them thousands of times."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from katana450.extensions.general_arms.links import DHLinks, sine_and_cosine

Motion = tuple[tuple[float, ...], list[tuple[float, float, float, float, float, float]]]
"""Pose and axes as `tool_and_jacobian` returns them."""


def tool_and_jacobian(
    links: DHLinks,
) -> Callable[[Sequence[float]], Motion]:
    """Return state(q) on plain floats: the tool's rotation and place, and the joints' axes.

    The first value has 12 numbers: the rotation by columns, then the place [m]. Each axis has 6:
    its direction, and the velocity [m/rad] that it gives to the tool point. All are in the frame of
    axis 1.
    """
    n = links.n
    steps = [
        (
            links.shift[i],
            *(
                (links.a[i], links.d[i], *sine_and_cosine(links.t[i]), links.b[i])
                if i < n - 1
                else (0.0, 0.0, 0.0, 1.0, 0.0)
            ),
        )
        for i in range(n)
    ]
    tool = links.T_n_tool
    (t11, t12, t13, tx), (t21, t22, t23, ty), (t31, t32, t33, tz) = tool[:3].tolist()
    cos, sin = math.cos, math.sin

    def state(q: Sequence[float]) -> Motion:
        xx, xy, xz, yx, yy, yz, zx, zy, zz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
        px = py = pz = 0.0
        axes = []
        for theta, (shift, a, d, st, ct, tilt) in zip(q, steps, strict=True):
            axes.append((zx, zy, zz, px, py, pz))
            c, s = cos(theta + shift), sin(theta + shift)
            xx, yx = c * xx + s * yx, c * yx - s * xx
            xy, yy = c * xy + s * yy, c * yy - s * xy
            xz, yz = c * xz + s * yz, c * yz - s * xz
            if d:
                px, py, pz = px + d * zx, py + d * zy, pz + d * zz
            if a:
                px, py, pz = px + a * xx, py + a * xy, pz + a * xz
            if st:
                yx, zx = ct * yx + st * zx, ct * zx - st * yx
                yy, zy = ct * yy + st * zy, ct * zy - st * yy
                yz, zz = ct * yz + st * zz, ct * zz - st * yz
            elif ct < 0.0:
                yx, yy, yz, zx, zy, zz = -yx, -yy, -yz, -zx, -zy, -zz
            if tilt:
                c, s = cos(tilt), sin(tilt)
                xx, zx = c * xx - s * zx, c * zx + s * xx
                xy, zy = c * xy - s * zy, c * zy + s * xy
                xz, zz = c * xz - s * zz, c * zz + s * xz
        px, py, pz = (
            px + tx * xx + ty * yx + tz * zx,
            py + tx * xy + ty * yy + tz * zy,
            pz + tx * xz + ty * yz + tz * zz,
        )
        pose = (
            t11 * xx + t21 * yx + t31 * zx, t11 * xy + t21 * yy + t31 * zy,
            t11 * xz + t21 * yz + t31 * zz,
            t12 * xx + t22 * yx + t32 * zx, t12 * xy + t22 * yy + t32 * zy,
            t12 * xz + t22 * yz + t32 * zz,
            t13 * xx + t23 * yx + t33 * zx, t13 * xy + t23 * yy + t33 * zy,
            t13 * xz + t23 * yz + t33 * zz,
            px, py, pz,
        )  # fmt: skip
        moved = []
        for ax, ay, az, ox, oy, oz in axes:
            rx, ry, rz = px - ox, py - oy, pz - oz
            moved.append((ax, ay, az, ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx))
        return pose, moved

    return state
