"""Fittings of the links: conduit ends are in the fittings, letters are legible."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from katana450.resources import URDF_PATH
from robot_description.cad.build import CONDUITS, write_conduits
from robot_description.cad.conduit import STRETCHES
from robot_description.cad.lettering import lettering, wrapped
from robot_description.cad.solid import aimed, rod
from tests.robot_description.solids import solid

ENDS = [
    (conduit["name"], number, conduit["radius"], end)
    for conduit in json.loads(CONDUITS.read_text(encoding="utf-8"))["conduits"]
    for number, end in enumerate(conduit["ends"])
]


def test_the_committed_ends_are_those_of_the_design(tmp_path: Any) -> None:
    write_conduits(tmp_path / "conduits.json")
    assert (tmp_path / "conduits.json").read_bytes() == CONDUITS.read_bytes()
    assert CONDUITS.parent == URDF_PATH.parent


@pytest.mark.parametrize(("name", "number", "radius", "end"), ENDS)
def test_an_end_sits_in_a_fitting_and_has_room_before_it(
    name: str, number: int, radius: float, end: dict[str, Any]
) -> None:
    point, tangent = np.array(end["point"]) * 1e3, np.array(end["tangent"])
    assert np.linalg.norm(tangent) == pytest.approx(1.0, abs=1e-5), name
    link, thick = solid(end["link"]), 2e3 * radius
    held = aimed(rod(thick + 1.0, -1.0, 1.0), tuple(tangent), tuple(point))
    assert (link ^ held).volume() > 10.0, "no fitting grips the conduit"
    outward = tangent if number == 0 else -tangent
    free = aimed(rod(thick, 3.0, 40.0), tuple(outward), tuple(point))
    assert (link ^ free).volume() < 1e-6, "the conduit runs into its own link"


def test_the_stretches_follow_one_another_from_the_base_to_the_wrist() -> None:
    links = [stretch.start.link for stretch in STRETCHES] + [STRETCHES[-1].end.link]
    assert links == ["arm_base_link", "pan_link", "upper_arm_link", "forearm_link", "wrist_link"]
    assert [s.end.link for s in STRETCHES] == links[1:]


def test_unknown_letters_are_refused() -> None:
    with pytest.raises(ValueError, match="no strokes for \\['Q'\\]"):
        lettering("KATANA Q", 6.0, 0.5)


def test_wrapped_letters_lie_on_the_cylinder_and_read_from_outside() -> None:
    corners = np.asarray(wrapped("k0", 6.0, 0.5, 20.0).to_mesh64().vert_properties)
    reach = np.hypot(corners[:, 0], corners[:, 1])
    np.testing.assert_allclose(sorted({*np.round(reach, 2)}), [20.0, 20.5], atol=0.01)
    # Seen from outside with z up, the text runs towards +y: the closed 0 is its right half.
    right = corners[corners[:, 1] > 1.0]
    assert np.ptp(right[:, 2]) > 5.5
