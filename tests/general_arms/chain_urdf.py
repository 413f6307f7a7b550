"""URDF files of chains, with a rod as the shape of each link, for servers and whole sessions."""

from __future__ import annotations

import numpy as np

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

RADIUS = 0.02
"""[m] Radius of a rod."""

THIN = 0.01
"""[m] Length below which a link has no shape."""


def chain_urdf(name: str, chain: Chain) -> str:
    """Return a URDF with the joints of ``chain`` and the link ``tool0`` as its tool."""
    frames = _frames(chain)
    links = ["base_link", *(f"link{number + 1}" for number in range(chain.n)), "tool0"]
    ends = [*frames, chain.M]
    parts = [f'<robot name="{name}">', _link(links[0], np.eye(4), frames[0])]
    parts += [_link(links[k + 1], frames[k], ends[k + 1]) for k in range(chain.n)]
    before = np.eye(4)
    for k, T in enumerate(frames):
        parts.append(
            f'<joint name="{chain.names[k]}" type="revolute"><parent link="{links[k]}"/>'
            f'<child link="{links[k + 1]}"/>{_origin(se3.inverse(before) @ T)}<axis xyz="0 0 1"/>'
            f'<limit lower="{float(chain.lower[k])!r}" upper="{float(chain.upper[k])!r}" '
            f'velocity="{float(chain.speed[k])!r}" effort="10"/></joint>'
        )
        before = T
    parts.append(
        f'<link name="tool0"/><joint name="flange" type="fixed"><parent link="{links[-2]}"/>'
        f'<child link="tool0"/>{_origin(se3.inverse(before) @ chain.M)}</joint></robot>'
    )
    return "\n".join(parts)


def _frames(chain: Chain) -> list[FloatArray]:
    """Return a frame (4, 4) on each axis, whose z axis it is, in the base frame."""
    frames, origin = [], np.zeros(3)
    for w, v in zip(chain.S[:3].T, chain.S[3:].T, strict=True):
        foot = np.cross(w, v)
        origin = foot + (w @ (origin - foot)) * w
        frames.append(se3.from_rotation_translation(_with_z(w), origin))
    return frames


def _with_z(w: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is the unit vector ``w``."""
    x = np.eye(3)[int(np.abs(w).argmin())]
    x = x - (x @ w) * w
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(w, x), w))


def _link(name: str, T: FloatArray, end: FloatArray) -> str:
    """Return a link at ``T`` with a rod from there to ``end``, both (4, 4) in the base frame."""
    to = (se3.inverse(T) @ end)[:3, 3]
    size = float(np.linalg.norm(to))
    if size < THIN:
        return f'<link name="{name}"/>'
    middle = se3.from_rotation_translation(_with_z(to / size), 0.5 * to)
    shape = f'{_origin(middle)}<geometry><cylinder radius="{RADIUS}" length="{size!r}"/></geometry>'
    return f'<link name="{name}"><visual>{shape}</visual><collision>{shape}</collision></link>'


def _origin(T: FloatArray) -> str:
    xyz = " ".join(map(repr, T[:3, 3].tolist()))
    rpy = " ".join(map(repr, so3.to_rpy(T[:3, :3])))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'
