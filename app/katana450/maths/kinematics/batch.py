"""Forward kinematics of many postures at once, in chunks that fit the cache."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

CHUNK: Final = 4096
"""Number of poses per chunk: with fewer the calls dominate, with more the cache overflows."""


def forward_batch(chain: Chain, q: npt.ArrayLike) -> FloatArray:
    """Return T_S_tool (N, 4, 4) at the joint angles `q` (N, n) [rad], as `forward` for each.

    Raises InputError when `q` is not finite or has another shape.
    """
    q = number_array(q, (chain.n,), "The joint vectors")
    for pose, axis in np.argwhere(~np.isfinite(q))[:1].tolist():
        raise InputError(
            f"Joint vector {pose} has {q[pose, axis]} for axis {axis + 1}; give angles."
        )
    result = np.empty((len(q), 4, 4))
    for rows in chunks(len(q)):
        result[rows] = forward_columns(chain, q[rows].T).transpose(2, 0, 1)
    return result


def errors_of(chain: Chain, q: FloatArray, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the errors (N, k) [m], [rad] of joint angles `q` (N, k, n) for poses `T` (N, 4, 4).

    Angles that are not numbers, of a branch without a posture, have infinite errors.
    """
    count, k, n = q.shape
    is_missing = np.asarray(np.isnan(q).any(axis=-1))
    postures = np.where(is_missing[..., None], 0.0, q).reshape(-1, n)
    reached = forward_batch(chain, postures).reshape(count, k, 4, 4)
    x, y, z = np.moveaxis(reached[..., :3, 3] - T[:, None, :3, 3], -1, 0)
    distance = np.hypot(np.hypot(x, y), z)
    R = reached[..., :3, :3].swapaxes(-1, -2) @ T[:, None, :3, :3]
    sine = 0.5 * np.linalg.norm(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]],
        axis=0,
    )
    turn = np.arctan2(sine, 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0))
    distance[is_missing] = turn[is_missing] = np.inf
    return distance, turn


def chunks(n: int) -> Iterator[slice]:
    """Return the slices of at most CHUNK poses."""
    return (slice(start, min(start + CHUNK, n)) for start in range(0, n, CHUNK))


def number_array(value: npt.ArrayLike, shape: tuple[int, ...], name: str) -> FloatArray:
    """Return `value` (N, *shape) as float64; NaN and infinity are allowed.

    Raises InputError when `value` has another shape or type.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} are not a regular array: {error}.") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} hold {array.dtype} values; give plain finite numbers.")
    if array.ndim != 1 + len(shape) or array.shape[1:] != shape:
        wanted = ", ".join(["N", *map(str, shape)])
        raise InputError(f"{name} have shape {array.shape}; it must be ({wanted}).")
    return array.astype(np.float64, copy=False)


def jacobian_batch(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return T_S_tool (N, 4, 4) and the Jacobian (N, 6, n) of the tool at `q` (N, n), unchecked.

    The Jacobian is in the frame of the tool, as that of `jacobian_body`.
    """
    stages = np.empty((chain.n, 3, 4, len(q)))
    T = forward_columns(chain, q.T, stages).transpose(2, 0, 1)
    R, J = stages[:, :, :3], np.empty((len(q), 6, chain.n))
    np.einsum("njic,jn->cin", R, chain.S[:3], out=J[:, :3])
    np.einsum("njic,njc->cin", R, stages[:, :, 3], out=J[:, 3:])
    return T, J


def forward_columns(chain: Chain, q: FloatArray, stages: FloatArray | None = None) -> FloatArray:
    """Return T_S_tool (4, 4, C) at q (n, C).

    Each factor is exp(hat(S_i) q_i) = I + sin X + (1 - cos) X^2. Before the factor of a joint, T is
    the pose of the tool with this joint at the base: ``stages`` (n, 3, 4, C) takes its rotation,
    and the velocity of the tool point by the joint.
    """
    T: FloatArray = np.empty((4, 4, q.shape[1]))
    T[:] = chain.M[:, :, None]
    for i in range(chain.n)[::-1]:
        flat = T.reshape(4, -1)
        turned = (chain.generators[i] @ flat).reshape(T.shape)
        twice = (chain.generators_squared[i] @ flat).reshape(T.shape)
        if stages is not None:
            stages[i, :, :3], stages[i, :, 3] = T[:3, :3], turned[:3, 3]
        turned *= q[i] if chain.slides[i] else np.sin(q[i])
        twice *= 2.0 * np.sin(0.5 * q[i]) ** 2
        T += turned
        T += twice
    return T
