"""Functions that send poses to the browsers without viser's setters.

viser's setters compare each pose with the last one within a tolerance. This costs ten times as much
as the message and drops small turns. The functions here send the same messages and update the
handles. Tests check this for the pinned version of viser.
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
"""x, y, z [m]."""


def turn(node: Any, wxyz: Quaternion) -> None:
    """Set the rotation of a scene node in its parent."""
    node._impl.wxyz = np.array(wxyz)
    node._impl.api._queue_scene_message(wire.SetOrientationMessage(node.name, wxyz))


def place(node: Any, position: Point) -> None:
    """Set the position [m] of a scene node in its parent."""
    node._impl.position = np.array(position)
    node._impl.api._queue_scene_message(wire.SetPositionMessage(node.name, position))


def arrange(
    node: viser.BatchedMeshHandle,
    wxyzs: npt.NDArray[np.float32],
    positions: npt.NDArray[np.float32],
) -> None:
    """Set the poses of all instances of a mesh, (n, 4) and (n, 3) [m], in one message.

    The handle keeps the arrays, so the caller must not change them afterwards.
    """
    props: Any = node._impl.props
    props.batched_wxyzs, props.batched_positions = wxyzs, positions
    updates = {"batched_wxyzs": wxyzs, "batched_positions": positions}
    node._impl.api._queue_scene_message(wire.SceneNodeUpdateMessage(node.name, updates))
