"""Poses sent without viser's setters give the same messages and update the handles."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from viser import _messages as wire

from katana450.extensions.conduit import ring
from katana450.server.viser_bridge.posing import arrange, place, turn
from tests.viser_bridge.internals import sent

TURN = (0.6, 0.0, -0.8, 0.0)
POINT = (0.1, -0.2, 0.3)


def messages_for(server: viser.ViserServer, kind: type[Any], node: str) -> list[Any]:
    """Return the messages about a node for a browser that connects now."""
    return [
        message for message in sent(server) if isinstance(message, kind) and message.name == node
    ]


def test_pose_message_is_identical_to_that_of_viser(server: viser.ViserServer) -> None:
    theirs, ours = (server.scene.add_frame(name) for name in ("/theirs", "/ours"))
    theirs.wxyz, theirs.position = np.array(TURN), np.array(POINT)
    turn(ours, TURN)
    place(ours, POINT)
    for kind in (wire.SetOrientationMessage, wire.SetPositionMessage):
        (a,), (b,) = messages_for(server, kind, "/theirs"), messages_for(server, kind, "/ours")
        a.name = b.name
        assert a.as_serializable_dict() == b.as_serializable_dict()
    np.testing.assert_array_equal(ours.wxyz, theirs.wxyz)
    np.testing.assert_array_equal(ours.position, theirs.position)


def test_turn_below_the_tolerance_of_visers_setter_is_sent(
    server: viser.ViserServer,
) -> None:
    frame = server.scene.add_frame("/frame", wxyz=TURN)
    little = (0.600001, 0.0, -0.79999925, 0.0)
    frame.wxyz = np.array(little)
    (message,) = messages_for(server, wire.SetOrientationMessage, "/frame")
    assert message.wxyz == TURN
    turn(frame, little)
    (message,) = messages_for(server, wire.SetOrientationMessage, "/frame")
    assert message.wxyz == little


def test_poses_of_instances_are_sent_in_one_message(
    server: viser.ViserServer,
) -> None:
    random = np.random.default_rng(450)
    wxyzs, positions = (random.normal(size=(5, k)).astype(np.float32) for k in (4, 3))
    theirs, ours = (
        server.scene.add_batched_meshes_simple(
            name, *ring(0.01), np.tile([1.0, 0.0, 0.0, 0.0], (5, 1)), np.zeros((5, 3))
        )
        for name in ("/theirs", "/ours")
    )
    theirs.batched_wxyzs, theirs.batched_positions = wxyzs, positions
    arrange(ours, wxyzs, positions)
    (message,) = messages_for(server, wire.SceneNodeUpdateMessage, "/ours")
    expected: dict[str, Any] = {}
    for update in messages_for(server, wire.SceneNodeUpdateMessage, "/theirs"):
        expected |= update.updates
    assert message.updates.keys() == expected.keys()
    for name, value in expected.items():
        assert message.updates[name].dtype == value.dtype
        np.testing.assert_array_equal(message.updates[name], value)
        np.testing.assert_array_equal(getattr(ours, name), value)
