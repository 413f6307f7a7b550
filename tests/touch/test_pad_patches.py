"""The coloured patches on the fingers in viser's scene."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.assembly.robot_session import DescribedRobot
from katana450.extensions.touch.pad import COLUMNS, ROWS
from katana450.extensions.touch.pad_patches import (
    COLOURS,
    FULL_PRESSURE,
    HIDDEN,
    PadPatches,
    pressure_colours,
)
from katana450.extensions.touch.touch_model import TouchModel
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.resources import STATIC


def test_patches_show_what_is_pressed_and_vanish(
    server: viser.ViserServer,
    described: DescribedRobot,
    session: Session,
    model: TouchModel,
    around: State,
    holding: State,
) -> None:
    shown = [around]
    arm = SimpleNamespace(environment=session.environment)
    context: Any = SimpleNamespace(
        server=server, robot=described.robot, state=lambda: shown[-1], hub=SimpleNamespace(arm=arm)
    )
    patches = PadPatches(context)
    patches.follow()
    assert patches._pads == []
    shown.append(holding)
    patches.follow()
    squeeze = model.squeeze(holding)
    assert squeeze is not None
    pressures = squeeze.pads
    for pad in patches._pads:
        node = pad._node
        assert node.visible
        assert node.name.endswith("_link/touch")
        drawn = np.asarray(node.batched_scales)[:, 0] > 2.0 * HIDDEN
        # Some taxels and their rims on both sides are pressed, most are not.
        assert 16 <= drawn[:128].sum() < 64
        assert drawn[128:144].sum() == drawn[144:].sum() > 0
        # The rims are white at the centre of pressure; the force stands behind the finger there.
        (touch,) = (pressure for pressure in pressures if pressure.finger in node.name)
        assert touch.centre is not None
        place = 16 * touch.centre[0] / pad._pad.length
        colours = np.asarray(node.batched_colors)
        white = np.flatnonzero(
            (colours == colours.max(axis=0)).all(axis=1) & (np.ptp(colours, axis=1) == 0)
        )
        assert white.tolist() == [128 + int(place), 144 + int(place)]
        assert pad._label.visible
        assert pad._label.text == f"{touch.force:.1f} N"
        away = np.linalg.norm(
            np.asarray(pad._label.position) - pad._pad.middles[int(place)].mean(axis=0)
        )
        assert away == pytest.approx(0.03)
        assert len(np.unique(np.asarray(node.batched_colors)[drawn], axis=0)) > 1
    colours = np.asarray(patches._pads[0]._node.batched_colors)
    patches.follow()
    assert (
        np.asarray(patches._pads[0]._node.batched_colors) is colours
        or (np.asarray(patches._pads[0]._node.batched_colors) == colours).all()
    )
    shown.append(around)
    patches.follow()
    assert not any(pad._node.visible or pad._label.visible for pad in patches._pads)


def test_colours_rise_with_the_pressure() -> None:
    blue, *_, red = pressure_colours(np.array((0.0, 25e3, 1e9)))
    assert blue[2] > blue[0]
    assert red[0] > red[2]


def test_page_draws_pads_with_the_same_numbers(model: TouchModel) -> None:
    script = (STATIC / "touch" / "maps.js").read_text(encoding="utf-8")
    (pad, _) = model.pads

    def constant(name: str) -> Any:
        return json.loads(script.split(f"const {name} = ")[1].split(";")[0].replace("_", ""))

    assert (constant("ROWS"), constant("COLUMNS")) == (ROWS, COLUMNS)
    assert constant("FULL") == FULL_PRESSURE
    assert constant("COLOURS") == COLOURS.tolist()
    assert constant("[LENGTH, WIDTH]") == pytest.approx(
        [1e3 * pad.length, 1e3 * pad.width], abs=0.05
    )
    rumble = (STATIC / "touch" / "rumble.js").read_text(encoding="utf-8")
    assert f"const MIN_CLEARANCE = {MIN_CLEARANCE:g};" in rumble
