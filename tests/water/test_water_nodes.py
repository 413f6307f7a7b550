"""Water in viser's scene: only moving water is sent."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.robot.props import load_props, water_environment
from katana450.extensions.water import WORTH_SENDING, WaterNodes
from katana450.maths.geometry import so3
from katana450.maths.water.flow import VesselMove, WaterFlow
from katana450.maths.water.parcel import THICKNESS, Puddle
from katana450.maths.water.surface import COLOUR
from tests.viser_bridge.internals import nodes, outlet
from tests.water.motions import over_basin, placed, poured, turned_to

FLOW = WaterFlow(water_environment(load_props()))


class Recorded:
    """A server, the water that it draws, and the messages about the water."""

    def __init__(self, server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch) -> None:
        self.server = server
        self.nodes = WaterNodes(server, FLOW.water_environment)
        self._messages: list[Any] = []
        interface = outlet(server)
        queue = interface.queue_message

        def record(message: Any, *rest: Any) -> Any:
            self._messages.append(message)
            return queue(message, *rest)

        monkeypatch.setattr(interface, "queue_message", record)

    def since(self) -> list[Any]:
        """Return the messages since the last call."""
        messages, self._messages[:] = list(self._messages), []
        return messages

    def node(self, name: str) -> Any:
        return nodes(self.server)[f"/water/{name}"]

    def visible(self, name: str) -> bool:
        return f"/water/{name}" in nodes(self.server) and bool(self.node(name).visible)


@pytest.fixture
def recorded(server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch) -> Recorded:
    return Recorded(server, monkeypatch)


def test_water_at_rest_is_sent_once(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    recorded.nodes.show(water)
    assert recorded.since()
    for _ in range(20):
        water = FLOW.step(water, {"cup": VesselMove(water.cup.T)}, 0.01)
        recorded.nodes.show(water)
    assert recorded.since() == []


def test_level_motion_of_the_cup_moves_its_water(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    recorded.nodes.show(water)
    recorded.since()
    recorded.nodes.show(FLOW.step(water, {"cup": VesselMove(placed(0.3, 0.12, 0.2))}, 0.01))
    assert len(recorded.since()) == 1
    x, y, z = recorded.node("vessel0").vertices.mean(axis=0)
    level = 2e-4 / (math.pi * FLOW.water_environment.cup.inside.radius**2)
    assert (x, y) == pytest.approx((0.3, 0.12), abs=1e-3)
    assert z == pytest.approx(0.2 + FLOW.water_environment.cup.floor + 0.5 * level, abs=1e-5)


def test_every_stage_of_a_pour_is_shown(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, over_basin(FLOW.water_environment, 0.0))
    recorded.nodes.show(water)
    assert recorded.visible("vessel0")
    assert not recorded.visible("stream")
    assert not recorded.visible("basin")
    heights = []
    for after in poured(FLOW, water, turned_to(2.0, 1.0), 4.0, 0.02):
        recorded.nodes.show(after)
        assert recorded.visible("stream") is bool(after.parcels)
        if after.parcels:
            assert np.isfinite(recorded.node("stream").vertices).all()
        if recorded.visible("basin"):
            heights.append(float(recorded.node("basin").vertices[0, 2]))
    assert not recorded.visible("vessel0")
    assert recorded.visible("basin")
    assert heights == sorted(heights)
    basin = FLOW.water_environment.basin
    level = basin.level(2e-4)
    floor = basin.at[2] + basin.floor
    assert heights[-1] == pytest.approx(floor + level, abs=WORTH_SENDING)
    middle, *rim = recorded.node("basin").vertices[:, :2]
    radii = np.linalg.norm(np.array(rim) - middle, axis=1)
    assert radii == pytest.approx(np.full(len(radii), basin.radius(level)), abs=2 * WORTH_SENDING)
    assert recorded.since()


def test_surface_is_level_in_a_tilted_cup(recorded: Recorded) -> None:
    T = placed(0.3, 0.1, 0.2, math.radians(25.0))
    T[:3, :3] = so3.exp((0.0, 0.0, 1.1)) @ T[:3, :3]
    recorded.nodes.show(FLOW.begin(1.5e-4, T))
    corners = recorded.node("vessel0").vertices
    upper = corners[-len(corners) // 4 :]
    # The tolerance is the distance of the drawn water from the wall.
    assert np.ptp(upper[:, 2]) < 1e-3


def test_a_puddle_lies_where_water_fell_and_grows(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, placed(0.3, -0.2, 0.1))
    areas = []
    for k in range(200):
        water = FLOW.step(
            water, {"cup": VesselMove(placed(0.3, -0.2, 0.1, min(0.02 * k, 2.0)))}, 0.01
        )
        recorded.nodes.show(water)
        if water.puddles:
            corners = recorded.node("puddle0").vertices
            x, y = np.ptp(corners[:, :2], axis=0)
            areas.append(0.25 * x * y * math.pi * THICKNESS)
    assert areas == sorted(areas)
    assert areas[-1] == pytest.approx(water.puddles[0].volume * 1e-18, rel=0.1)
    # The first corner is in the middle.
    assert corners[0, :2] == pytest.approx(water.puddles[0].at[:2], abs=WORTH_SENDING)
    # After a restart the table is dry.
    recorded.nodes.show(FLOW.begin(2e-4, placed(0.3, -0.2, 0.1)))
    assert not recorded.visible("puddle0")


def test_water_has_one_colour_everywhere(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, placed(0.3, -0.2, 0.1))
    recorded.nodes.show(water)
    assert not recorded.visible("basin")
    water = replace(water, basin=10**14, puddles=(Puddle((0.3, 0.0, 0.0), 10**12),))
    recorded.nodes.show(water)
    for name in ("vessel0", "basin", "puddle0"):
        assert recorded.visible(name)
        assert recorded.node(name).color == COLOUR


def test_hidden_water_can_be_shown_again(recorded: Recorded) -> None:
    root = nodes(recorded.server)["/water"]
    shown = [root.visible]
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    recorded.nodes.show(water)
    shown.append(root.visible)
    recorded.nodes.hide()
    shown.append(root.visible)
    recorded.nodes.show(water)
    shown.append(root.visible)
    assert shown == [False, True, False, True]


def test_shapes_have_few_vertices(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, over_basin(FLOW.water_environment, 0.0))
    *_, water = poured(FLOW, water, turned_to(2.0, 1.0), 1.0, 0.01)
    recorded.nodes.show(water)
    assert len(recorded.node("vessel0").vertices) + len(recorded.node("stream").vertices) < 400
    assert recorded.node("stream").vertices.dtype == np.float32
