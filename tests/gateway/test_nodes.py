"""Test reading and setting the VRML world by name."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.client import RefusedError
from katana450.server.api import requests
from tests.exchange.joint_rotations import THERE, rotation
from tests.gateway.virtual import Rows, VirtualServer


def arrived(lines: Rows, ticket: int) -> None:
    """Wait until the arm rests and its state includes the command of ``ticket``."""
    while (now := lines.answer(do="query"))["ticket"] < ticket or now["moving"]:
        time.sleep(0.02)


def all_joints(q: dict[str, float]) -> dict[str, Any]:
    (node, angle), *rest = q.items()
    more = [{"node": n, "field": "rotation", "value": rotation(n, a)} for n, a in rest]
    return {"node": node, "field": "rotation", "value": rotation(node, angle), "more": more}


def test_arm_is_driven_by_name_over_tcp(local: VirtualServer, arm: MountedArm) -> None:
    T_base_shoulder = arm.T_base_shoulder
    with local.speaking("VR Sink") as lines:
        before = lines.answer(do="query")["q"]
        done = lines.answer(do="set", **all_joints(THERE))
        assert done["is"] == "done"
        soon = lines.answer(do="get", node="axis_1", field="rotation")["values"][0]["value"][3]
        # The arm is still moving, under its own limits.
        assert abs(soon - before[0]) < 0.1
        arrived(lines, done["ticket"])
        more = [{"node": name, "field": "rotation"} for name in THERE]
        values = lines.answer(do="get", node="tcp", field="translation", more=more)["values"]
        assert [value["node"] for value in values] == ["tcp", *THERE]
        tool = values[0]["value"]
        # The root's frame stands on the table, {S} is in the shoulder.
        T = T_base_shoulder @ np.array(lines.answer(do="query")["T"])
        np.testing.assert_allclose(tool, T[:3, 3], rtol=0, atol=1e-9)
        for value, (name, angle) in zip(values[1:], THERE.items(), strict=True):
            np.testing.assert_allclose(value["value"], rotation(name, angle), rtol=0, atol=1e-9)
        # The tool is set by its name too.
        place = [tool[0], tool[1], tool[2] + 0.01]
        done = lines.answer(do="set", node="tcp", field="translation", value=place)
        arrived(lines, done["ticket"])
        values = lines.answer(do="get", node="tcp", field="translation")["values"]
        np.testing.assert_allclose(values[0]["value"], place, rtol=0, atol=1e-6)
        lines.answer(do="set", **all_joints(THERE))
        # Either all fields are set or none.
        bad = all_joints({**THERE, "axis_1": 0.0})
        bad["more"][-1]["value"] = [0, 1, 0, 0.1]
        refused = lines.answer(do="set", **bad)
        assert refused["is"] == "refused"
        assert "axis_5 turns about 1 0 0" in refused["why"]
        assert lines.answer(do="query")["goal"][0] == THERE["axis_1"]
        # A stop also blocks commands by name.
        lines.answer(do="stop")
        stopped = lines.answer(do="set", node="axis_1", field="rotation", value=[0, 0, 1, 0])
        assert "clear the stop first" in stopped["why"]
        assert lines.clear_stop()["is"] == "done"
        arrived(lines, lines.answer(do="home")["ticket"])
        lines.answer(do="release_lease")


CUP = [0.34, -0.26, 0.0]
"""Place of the cup when a server starts [m]."""


def test_objects_are_set_and_watched_by_name(local: VirtualServer) -> None:
    with local.speaking("Mover") as lines:
        lines.answer(
            do="set", node="cup", field="translation", value=[0.3, 0.2, 0.0],
            more=[{"node": "cup", "field": "rotation", "value": [0, 0, 1, 0.5]}],
        )  # fmt: skip
        lines.say(
            do="watch", hz=20,
            fields=[{"node": "cup", "field": "translation"},
                    {"node": "cup", "field": "rotation"},
                    {"node": "axis_2", "field": "rotation"}],
        )  # fmt: skip
        values: list[Any] = []
        while not values or values[0] != [0.3, 0.2, 0.0]:
            state = lines.hear()
            values = [entry["value"] for entry in state.get("fields", ())]
        np.testing.assert_allclose(values[1], [0.0, 0.0, 1.0, 0.5], rtol=0, atol=1e-12)
        assert values[2] == [0.0, 1.0, 0.0, state["q"][1]]
        lines.say(do="watch", hz=0)
        nothing = lines.answer(do="watch", hz=5, fields=[{"node": "cups", "field": "translation"}])
        assert "no node 'cups'" in nothing["why"]
        with (
            local.connect("Watcher") as watcher,
            pytest.raises(RefusedError, match="Mover holds"),
        ):
            watcher.ask(requests.Set(node="cup", field="translation", value=CUP))
        lines.answer(
            do="set", node="cup", field="translation", value=CUP,
            more=[{"node": "cup", "field": "rotation", "value": [0, 0, 1, 0]}],
        )  # fmt: skip
        lines.answer(do="release_lease")
