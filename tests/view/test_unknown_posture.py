"""An arm that is not connected is not drawn as if somebody knew where it is."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.control.arm_report import ArmMode, ArmReport
from katana450.arm.control.session import Session
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.options import view_layer
from katana450.server.view.layer import ViewLayer
from katana450.server.view.scenery import Scenery
from tests.viser_bridge.internals import nodes


def layer(arm: str | None) -> ViewLayer | None:
    return view_layer(Namespace(arm=arm))


def test_simulated_arm_has_no_such_layer() -> None:
    assert layer(None) is None


@pytest.mark.parametrize("mode", ArmMode)
def test_links_of_an_arm_are_drawn_while_it_is_connected(
    robot: Robot, server: viser.ViserServer, session: Session, mode: ArmMode
) -> None:
    found = layer("tcp://arm:5566")
    assert found is not None
    gestures: Any = SimpleNamespace(listen=lambda *_: None)
    scenery = Scenery(server, robot, session, load_props(), gestures, Meshes(), (found,))
    rest = session.begin(session.ready, 0.0, 0.0)
    still, unknown = np.zeros(6), mode is ArmMode.DISCONNECTED
    for shown, hidden in ((ArmMode.HOLDING, False), (mode, unknown), (ArmMode.MOVING, False)):
        scenery.show(replace(rest, report=ArmReport(shown, 0.0, still, still)))
        drawn = {name.rpartition("/")[2]: node.visible for name, node in nodes(server).items()}
        assert drawn[robot.links[0].name]
        for link in robot.links:
            if link.joint is not None:
                assert drawn[link.name] == (not hidden)
