"""Water as viser is told of it: what moves is sent, what rests is not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.robot.props import load_props
from katana450.arm.robot.water import water_environment
from katana450.maths.geometry import so3
from katana450.maths.water.flow import WaterFlow
from katana450.maths.water.puddle import THICKNESS
from katana450.server.view.water import WORTH_SENDING, WaterNodes
from tests.viser_bridge.internals import nodes, outlet
from tests.water.motions import UPRIGHT, over_basin, placed, poured, turned_to

FLOW = WaterFlow(water_environment(load_props()))


class Told:
    """A server, the water drawn by it, and every message about it since last asked."""

    def __init__(self, server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch) -> None:
        self.server = server
        self.nodes = WaterNodes(server, FLOW.water_environment)
        self._messages: list[Any] = []
        interface = outlet(server)
        queue = interface.queue_message

        def told(message: Any, *rest: Any) -> Any:
            self._messages.append(message)
            return queue(message, *rest)

        monkeypatch.setattr(interface, "queue_message", told)

    def since(self) -> list[Any]:
        said, self._messages[:] = list(self._messages), []
        return said

    def node(self, name: str) -> Any:
        return nodes(self.server)[f"/water/{name}"]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Iterator[Told]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield Told(server, monkeypatch)
    finally:
        server.stop()


def test_water_at_rest_is_sent_once(told: Told) -> None:
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    told.nodes.show(water)
    assert told.since()
    for _ in range(20):
        water = FLOW.step(water, water.T_base_cup, UPRIGHT, 0.01)
        told.nodes.show(water)
    assert told.since() == []


def test_a_cup_that_moves_level_takes_its_water_along(told: Told) -> None:
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    told.nodes.show(water)
    told.since()
    told.nodes.show(FLOW.step(water, placed(0.3, 0.12, 0.2), UPRIGHT, 0.01))
    assert len(told.since()) == 1
    x, y, z = told.node("cup").vertices.mean(axis=0)
    level = 2e-4 / (math.pi * FLOW.water_environment.cup.inside.radius**2)
    assert (x, y) == pytest.approx((0.3, 0.12), abs=1e-3)
    assert z == pytest.approx(0.2 + FLOW.water_environment.cup.floor + 0.5 * level, abs=1e-5)


def test_all_of_a_pour_is_seen(told: Told) -> None:
    water = FLOW.begin(2e-4, over_basin(FLOW.water_environment, 0.0))
    told.nodes.show(water)
    assert told.node("cup").visible
    assert not told.node("stream").visible
    assert not told.node("basin").visible
    heights = []
    for after in poured(FLOW, water, turned_to(2.0, 1.0), 4.0, 0.02):
        told.nodes.show(after)
        assert told.node("stream").visible is bool(after.parcels)
        if after.parcels:
            assert np.isfinite(told.node("stream").vertices).all()
        heights.append(told.node("basin").scale[2] if told.node("basin").visible else 0.0)
    assert not told.node("cup").visible
    assert told.node("basin").visible
    assert heights == sorted(heights)
    level = FLOW.water_environment.basin.level(2e-4)
    assert heights[-1] == pytest.approx(level, abs=WORTH_SENDING)
    radius = FLOW.water_environment.basin.radius(level)
    assert told.node("basin").scale[:2] == pytest.approx((radius, radius), abs=WORTH_SENDING)
    assert told.since()


def test_the_surface_is_level_however_the_cup_is_held(told: Told) -> None:
    T = placed(0.3, 0.1, 0.2, math.radians(25.0))
    T[:3, :3] = so3.exp((0.0, 0.0, 1.1)) @ T[:3, :3]
    told.nodes.show(FLOW.begin(1.5e-4, T))
    corners = told.node("cup").vertices
    upper = corners[-len(corners) // 4 :]
    # But for the hair that it is drawn off the wall.
    assert np.ptp(upper[:, 2]) < 1e-3


def test_a_puddle_lies_where_water_fell_and_grows(told: Told) -> None:
    water = FLOW.begin(2e-4, placed(0.3, -0.2, 0.1))
    areas = []
    for k in range(200):
        water = FLOW.step(water, placed(0.3, -0.2, 0.1, min(0.02 * k, 2.0)), UPRIGHT, 0.01)
        told.nodes.show(water)
        if water.puddles:
            areas.append(told.node("puddle0").scale[0] ** 2 * math.pi * THICKNESS)
    assert areas == sorted(areas)
    assert areas[-1] == pytest.approx(water.puddles[0].volume * 1e-18)
    assert told.node("puddle0").position == pytest.approx(water.puddles[0].at)
    # Begun anew the table is dry.
    told.nodes.show(FLOW.begin(2e-4, placed(0.3, -0.2, 0.1)))
    assert not told.node("puddle0").visible


def test_hidden_water_comes_back(told: Told) -> None:
    root = nodes(told.server)["/water"]
    seen = [root.visible]
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    told.nodes.show(water)
    seen.append(root.visible)
    told.nodes.hide()
    seen.append(root.visible)
    told.nodes.show(water)
    seen.append(root.visible)
    assert seen == [False, True, False, True]


def test_a_shape_is_small_on_the_wire(told: Told) -> None:
    water = FLOW.begin(2e-4, over_basin(FLOW.water_environment, 0.0))
    *_, water = poured(FLOW, water, turned_to(2.0, 1.0), 1.0, 0.01)
    told.nodes.show(water)
    assert len(told.node("cup").vertices) + len(told.node("stream").vertices) < 400
    assert told.node("stream").vertices.dtype == np.float32
