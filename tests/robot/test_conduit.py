"""The conduit keeps to its fittings, its length and its way, whatever the joints do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from app.errors import RobotDescriptionError
from app.robot.model import CONDUITS, RobotModel, load
from app.view.conduit import PROFILE, SIDES, ring
from robot_description import URDF_PATH

DENSE = 400


def test_it_runs_from_the_base_to_the_wrist_over_every_bending_joint(model: RobotModel) -> None:
    assert [each.hinge.joint for each in model.stretches] == [f"axis_{i}" for i in range(1, 5)]
    assert [each.winds for each in model.stretches] == [True, False, False, False]


@pytest.mark.parametrize("number", range(4))
def test_it_leaves_one_fitting_and_arrives_at_the_other(model: RobotModel, number: int) -> None:
    """Where the URDF, read by other code, has the two links."""
    stretch = model.stretches[number]
    urdf = yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False, build_scene_graph=True)
    hinge = stretch.hinge
    for angle in np.linspace(hinge.lower, hinge.upper, 13):
        urdf.update_cfg({hinge.joint: angle})
        T = urdf.get_transform(stretch.end.link, stretch.start.link)
        (points,), (tangents,) = stretch.courses([angle], DENSE)
        end = T[:3, :3] @ stretch.end.point + T[:3, 3]
        assert np.linalg.norm(points[0] - stretch.start.point) < 2e-3
        assert np.linalg.norm(points[-1] - end) < 2e-3
        assert tangents[0] @ stretch.start.tangent > 0.9
        assert tangents[-1] @ (T[:3, :3] @ stretch.end.tangent) > 0.9
        assert np.allclose(np.linalg.norm(tangents, axis=1), 1.0)


@pytest.mark.parametrize("number", range(4))
def test_it_is_as_long_as_it_is_and_never_leaps(model: RobotModel, number: int) -> None:
    stretch = model.stretches[number]
    before = None
    for angle in np.linspace(stretch.hinge.lower, stretch.hinge.upper, 400):
        (points,), _ = stretch.courses([angle], DENSE)
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        length = steps.sum() * DENSE / (DENSE - 1)
        # Round axis 1 it is drawn out, as a spiral is; elsewhere it only hangs.
        assert length > 0.99 * stretch.length
        assert stretch.winds or length < 1.01 * stretch.length
        # Ribs are drawn at even steps along it.
        assert steps.max() < 1.1 * steps.min()
        if before is not None:
            assert np.linalg.norm(points - before, axis=1).max() < 5e-3
        before = points


def test_a_rib_is_a_closed_band_seen_from_outside() -> None:
    vertices, faces = ring(0.008)
    assert vertices.shape == (SIDES * len(PROFILE), 3)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    outward = (a + b + c)[:, 1:] / 3.0
    normal = np.cross(b - a, c - a)[:, 1:]
    assert ((outward * normal).sum(axis=1) > 0.0).all()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nonsense", "Expecting value"),
        ("{}", "conduits"),
        ('{"conduits": [{}]}', "ends"),
        ('{"conduits": 3}', "not iterable"),
    ],
)
def test_a_broken_file_is_refused(tmp_path: Path, text: str, said: str) -> None:
    urdf = tmp_path / URDF_PATH.name
    urdf.write_bytes(URDF_PATH.read_bytes())
    (tmp_path / CONDUITS).write_text(text, encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=said) as refused:
        load(urdf)
    assert CONDUITS in str(refused.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"radius": -1.0}, "thick"),
        ({"length": float("inf")}, "long"),
        ({"radius": "thick"}, "could not convert"),
        ({"ends": []}, "not enough values"),
    ],
)
def test_a_conduit_that_is_none_is_refused(
    tmp_path: Path, change: dict[str, object], said: str
) -> None:
    described = json.loads((URDF_PATH.parent / CONDUITS).read_text(encoding="utf-8"))
    described["conduits"][0].update(change)
    urdf = tmp_path / URDF_PATH.name
    urdf.write_bytes(URDF_PATH.read_bytes())
    (tmp_path / CONDUITS).write_text(json.dumps(described), encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=said):
        load(urdf)


@pytest.mark.parametrize(
    ("start", "end", "said"),
    [
        ("arm_base_link", "upper_arm_link", "2 driven joints"),
        ("upper_arm_link", "pan_link", "does not hang on"),
        ("roll_link", "flange", "0 driven joints"),
        ("nowhere", "wrist_link", "does not hang on"),
        ("arm_base_link", "nowhere", "nowhere"),
    ],
)
def test_ends_on_links_without_one_joint_between_are_refused(
    tmp_path: Path, start: str, end: str, said: str
) -> None:
    described = json.loads((URDF_PATH.parent / CONDUITS).read_text(encoding="utf-8"))
    for one, link in zip(described["conduits"][0]["ends"], (start, end), strict=True):
        one["link"] = link
    urdf = tmp_path / URDF_PATH.name
    urdf.write_bytes(URDF_PATH.read_bytes())
    (tmp_path / CONDUITS).write_text(json.dumps(described), encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=said):
        load(urdf)
