"""Water in viser's scene: only moving water is sent."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
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
from katana450.srgb import to_srgb
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


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> Iterator[Recorded]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield Recorded(server, monkeypatch)
    finally:
        server.stop()


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
    x, y, z = recorded.node("cup").vertices.mean(axis=0)
    level = 2e-4 / (math.pi * FLOW.water_environment.cup.inside.radius**2)
    assert (x, y) == pytest.approx((0.3, 0.12), abs=1e-3)
    assert z == pytest.approx(0.2 + FLOW.water_environment.cup.floor + 0.5 * level, abs=1e-5)


def test_every_stage_of_a_pour_is_shown(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, over_basin(FLOW.water_environment, 0.0))
    recorded.nodes.show(water)
    assert recorded.node("cup").visible
    assert not recorded.node("stream").visible
    assert not recorded.node("basin").visible
    heights = []
    for after in poured(FLOW, water, turned_to(2.0, 1.0), 4.0, 0.02):
        recorded.nodes.show(after)
        assert recorded.node("stream").visible is bool(after.parcels)
        if after.parcels:
            assert np.isfinite(recorded.node("stream").vertices).all()
        heights.append(recorded.node("basin").scale[2] if recorded.node("basin").visible else 0.0)
    assert not recorded.node("cup").visible
    assert recorded.node("basin").visible
    assert heights == sorted(heights)
    level = FLOW.water_environment.basin.level(2e-4)
    assert heights[-1] == pytest.approx(level, abs=WORTH_SENDING)
    radius = FLOW.water_environment.basin.radius(level)
    assert recorded.node("basin").scale[:2] == pytest.approx((radius, radius), abs=WORTH_SENDING)
    assert recorded.since()


def test_surface_is_level_in_a_tilted_cup(recorded: Recorded) -> None:
    T = placed(0.3, 0.1, 0.2, math.radians(25.0))
    T[:3, :3] = so3.exp((0.0, 0.0, 1.1)) @ T[:3, :3]
    recorded.nodes.show(FLOW.begin(1.5e-4, T))
    corners = recorded.node("cup").vertices
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
            areas.append(recorded.node("puddle0").scale[0] ** 2 * math.pi * THICKNESS)
    assert areas == sorted(areas)
    assert areas[-1] == pytest.approx(water.puddles[0].volume * 1e-18)
    assert recorded.node("puddle0").position == pytest.approx(water.puddles[0].at)
    # After a restart the table is dry.
    recorded.nodes.show(FLOW.begin(2e-4, placed(0.3, -0.2, 0.1)))
    assert not recorded.node("puddle0").visible


def test_water_has_one_colour_everywhere(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, placed(0.3, -0.2, 0.1))
    recorded.nodes.show(water)
    assert recorded.node("cup").color == recorded.node("stream").color == COLOUR
    assert not recorded.node("basin").visible
    water = replace(water, basin=10**14, puddles=(Puddle((0.3, 0.0, 0.0), 10**12),))
    recorded.nodes.show(water)
    for name in ("basin", "puddle0"):
        node = recorded.node(name)
        assert node.visible
        assert drawn(node.glb_data) == pytest.approx(COLOUR, abs=2.0)
    level = FLOW.water_environment.basin.level(1e-4)
    assert recorded.node("basin").scale[2] == pytest.approx(level)


def drawn(glb: bytes) -> list[float]:
    """Return red, green and blue (0 to 255, sRGB) of the material of a GLB file."""
    (size,) = struct.unpack("<I", glb[12:16])
    (material,) = json.loads(glb[20 : 20 + size])["materials"]
    factor = material["pbrMetallicRoughness"]["baseColorFactor"]
    return [255.0 * each for each in to_srgb(factor[:3]).tolist()]


def test_hidden_water_can_be_shown_again(recorded: Recorded) -> None:
    root = nodes(recorded.server)["/water"]
    seen = [root.visible]
    water = FLOW.begin(2e-4, placed(0.3, 0.1, 0.2))
    recorded.nodes.show(water)
    seen.append(root.visible)
    recorded.nodes.hide()
    seen.append(root.visible)
    recorded.nodes.show(water)
    seen.append(root.visible)
    assert seen == [False, True, False, True]


def test_shapes_have_few_vertices(recorded: Recorded) -> None:
    water = FLOW.begin(2e-4, over_basin(FLOW.water_environment, 0.0))
    *_, water = poured(FLOW, water, turned_to(2.0, 1.0), 1.0, 0.01)
    recorded.nodes.show(water)
    assert len(recorded.node("cup").vertices) + len(recorded.node("stream").vertices) < 400
    assert recorded.node("stream").vertices.dtype == np.float32
