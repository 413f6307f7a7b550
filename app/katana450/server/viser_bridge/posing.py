"""Poses on their way to the browsers, without viser's setters.

Those compare each pose to the one before within a tolerance, which costs ten times the message
itself and takes a small turn for none. What is sent here is what they send, and the handles know
it; that this is so for the exact version of viser that is pinned, tests hold.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import viser
from viser import _messages as wire

Quaternion = tuple[float, float, float, float]
"""w, x, y, z of a unit quaternion."""

Point = tuple[float, float, float]
"""[m]"""


def turn(node: Any, wxyz: Quaternion) -> None:
    """Turn a scene node in its parent."""
    node._impl.wxyz = np.array(wxyz)
    node._impl.api._queue_scene_message(wire.SetOrientationMessage(node.name, wxyz))


def place(node: Any, position: Point) -> None:
    """Put a scene node to where it is to be in its parent."""
    node._impl.position = np.array(position)
    node._impl.api._queue_scene_message(wire.SetPositionMessage(node.name, position))


def arrange(
    node: viser.BatchedMeshHandle,
    wxyzs: npt.NDArray[np.float32],
    positions: npt.NDArray[np.float32],
) -> None:
    """Give every instance of a mesh its pose, (n, 4) and (n, 3) [m], in one message.

    The arrays are handed over: whoever made them writes to them no more.
    """
    props: Any = node._impl.props
    props.batched_wxyzs, props.batched_positions = wxyzs, positions
    updates = {"batched_wxyzs": wxyzs, "batched_positions": positions}
    node._impl.api._queue_scene_message(wire.SceneNodeUpdateMessage(node.name, updates))
