"""A plate on a suction cup: held up to its force and to its friction, and only at a flat face."""

from __future__ import annotations

import math
from pathlib import Path
from zipfile import ZipFile

import mujoco
import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects import loose_objects
from katana450.arm.control.state.messages import REASONS, sentence
from katana450.arm.control.state.state import Finding, Reason
from katana450.cli.main import main
from katana450.errors import InputError, KatanaError
from katana450.extensions.programs.run.simulation import run_by_clock
from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import CollisionShape, box, cylinder, sphere
from katana450.maths.collision.world import Part
from katana450.maths.geometry import se3, so3
from katana450.maths.physics.model import (
    PAD_FRICTION,
    BodyMotion,
    RigidBody,
)
from katana450.maths.physics.simulation import BodySimulation
from katana450.maths.physics.suction import PRESSURE, SEAL_GAP, SuctionCup
from katana450.maths.water.units import GRAVITY
from tests.general_arms.published_hands import suction_urdf
from tests.general_arms.test_grasping import item, planned, played
from tests.physics.scenes import pose, pose_of
from tests.programs.test_pick_place import place
from tests.ticks import TICK, during

RADIUS, LENGTH, THICK = 0.02, 0.03, 0.004
"""[m] Radius and length of the cup, and thickness of the plate."""

FORCE = PRESSURE * math.pi * RADIUS**2
"""[N] Force of the pressure."""

PLATE = box((0.08, 0.08, THICK))


class Cup:
    """A cup that points down at zero and turns about y, and a body in touch with its rim."""

    def __init__(
        self, mass: float, shape: CollisionShape = PLATE, tilt: float = 0.0, aside: float = 0.0
    ) -> None:
        linkage = Linkage((RigidGroup(0, np.eye(4), np.eye(3)[1], 0),))
        cup = Part("cup", 1, (pose(0.0, 0.0, 0.5 * LENGTH),), (cylinder(RADIUS, LENGTH),))
        self._x = np.array((tilt,))
        R, depth = so3.rotation_y(tilt), 0.5 * float((shape.high - shape.low)[2])
        T = se3.from_rotation_translation(R, R @ (aside, 0.0, 1e-5 - depth))
        suction = SuctionCup(1, np.zeros(3), np.array((0.0, 0.0, -1.0)), RADIUS)
        body = RigidBody("plate", (shape,), (np.eye(4),), mass, 0.3)
        self._simulation = BodySimulation(linkage, (cup,), (body,), suction)
        self.motion = self._simulation.begin({"plate": T}, None, (), ("plate",))

    def run(self, seconds: float, held: str | None) -> BodyMotion:
        """Return the motion after ``seconds`` in which the cup holds what is ``held``."""
        for _ in range(round(seconds / TICK)):
            self.motion = self._simulation.step(self.motion, self._x, self._x, TICK, suction=held)
        return self.motion


@pytest.mark.parametrize(("load", "holds"), [(0.5, True), (0.98, True), (1.02, False)])
def test_cup_holds_up_to_its_force(load: float, holds: bool) -> None:
    cup = Cup(load * FORCE / GRAVITY)
    seal = cup.run(1.0, "plate").seal
    assert seal is not None
    assert seal.is_tight == holds
    if holds:
        assert abs(pose_of(cup.motion, "plate")[2, 3] + 0.5 * THICK) < 1e-5


def test_rim_presses_with_what_the_weight_leaves() -> None:
    cup = Cup(0.5 * FORCE / GRAVITY)
    pressing = math.fsum(contact.force for contact in cup.run(1.0, "plate").contacts)
    assert pressing == pytest.approx(0.5 * FORCE, rel=0.01)


@pytest.mark.parametrize("tilt", [0.5, 1.0, 0.5 * math.pi])
def test_tilted_plate_slides_at_the_limit_of_friction(tilt: float) -> None:
    """Along the cup the weight pulls it off, and across the cup friction holds it."""
    limit = PAD_FRICTION * FORCE / (math.sin(tilt) + PAD_FRICTION * math.cos(tilt))
    for load, slides in ((0.98, False), (1.02, True)):
        cup = Cup(load * limit / GRAVITY, tilt=tilt)
        before = pose_of(cup.run(0.1, "plate"), "plate")
        after = pose_of(cup.run(0.3, "plate"), "plate")
        way = float(np.linalg.norm(after[:3, 3] - before[:3, 3]))
        assert way > 1e-3 if slides else way < 1e-4


@pytest.mark.parametrize(
    ("shape", "aside", "tight"),
    [
        (PLATE, 0.0, True),
        (PLATE, 0.019, True),
        (PLATE, 0.023, False),
        (cylinder(RADIUS + 1e-3, 0.05), 0.0, True),
        (cylinder(RADIUS - 1e-3, 0.05), 0.0, False),
        (sphere(0.06), 0.0, False),
    ],
)
def test_cup_seals_on_a_flat_face(shape: CollisionShape, aside: float, tight: bool) -> None:
    seal = Cup(0.1, shape, aside=aside).run(TICK, "plate").seal
    assert seal is not None
    assert (seal.gap <= SEAL_GAP) == tight
    assert seal.is_tight == tight


def test_cup_that_is_off_holds_nothing() -> None:
    cup = Cup(0.1)
    assert cup.run(0.2, None).seal is None
    fall = 0.5 * GRAVITY * 0.2**2
    assert -float(pose_of(cup.motion, "plate")[2, 3]) - 0.5 * THICK == pytest.approx(fall, rel=0.1)


def test_script_picks_and_places_a_plate_with_a_suction_cup(tmp_path: Path) -> None:
    plate = item("plate", "box", (60.0, 50.0, 10.0), (500.0, 100.0), 17.0)
    steps = ["pick: plate", "place: {at: {x: 400, y: -200}}"]
    plan = planned(tmp_path, suction_urdf(0.01), steps, plate)
    assert place(played(plan)[-1].objects[0]) == pytest.approx([400.0, -200.0, 0.0], abs=0.5)
    hand, cup = plan.session.environment.hand, plan.session.require_arm().gripper
    assert hand is not None
    assert hand.cup is not None
    assert (cup.is_cup, cup.closed, cup.opened) == (True, 0.015, 0.0)
    assert hand.cup.force == pytest.approx(PRESSURE * math.pi * 0.01**2, rel=1e-3)


def test_cup_leaks_on_a_ball(tmp_path: Path) -> None:
    ball = item("ball", "sphere", (25.0,), (500.0, 100.0))
    with pytest.raises(InputError, match="would leak, because it needs a flat face as wide"):
        planned(tmp_path, suction_urdf(0.01), ["pick: ball"], ball)
    text = REASONS[Reason.LEAKING](Finding(Reason.LEAKING, 3e-3, parts=("suction_cup", "ball")))
    assert text.startswith("suction cup leaks on ball: its rim is 3.0 mm from a flat face")


def test_lost_and_leaking_objects_are_events_with_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plate = item("plate", "box", (60.0, 50.0, 10.0), (500.0, 100.0), 17.0)
    plan = planned(tmp_path, suction_urdf(0.01), ["pick: plate"], plate)
    held = played(plan)[-1]
    monkeypatch.setattr(loose_objects.LooseObjects, "mass", lambda *_: 1.7)
    lost = during(plan.session, held, 0.5, cmd.Nudge(1, 0.01))[-1]
    (finding,) = lost.findings
    assert finding.reason is Reason.SLIPPED
    assert finding.limit == pytest.approx(15.7, abs=0.05)
    assert 0.9 * finding.limit < finding.amount <= finding.limit
    text = "plate came off the suction cup under a load of 16 n, and at most 16 n are held"
    assert text in sentence(lost).lower()
    with pytest.raises(KatanaError, match="Plate slides on the suction cup under a load of 16 N"):
        run_by_clock(plan)


def test_exported_model_has_the_cup(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(suction_urdf(0.01), encoding="utf-8")
    assert main(["export", "mjcf", "--urdf", str(path), "--out", str(tmp_path)]) == 0
    ZipFile(tmp_path / "arm_mjcf.zip").extractall(tmp_path)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm" / "scene.xml"))
    suction = model.actuator("suction")
    assert suction.gainprm[0] == pytest.approx(PRESSURE * math.pi * 0.01**2, rel=1e-3)
    assert model.key_ctrl.shape == (2, 8)
    cup = model.body_geomadr[model.body("suction_cup").id]
    assert (model.geom_gap[cup], model.geom_friction[cup, 0]) == (SEAL_GAP, PAD_FRICTION)
