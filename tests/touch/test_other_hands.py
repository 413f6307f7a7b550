"""Forces of hands other than that of the Katana: of a single jaw, and of linkages of bars."""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.arm.control.objects.grip import FINGER_FORCE
from katana450.extensions.programs.run.simulation import run_by_clock
from katana450.server.service import serialize
from tests.general_arms.test_grasping import item, planned
from tests.general_arms.test_published_hands import KINDS


@pytest.mark.parametrize("name", ["SO-101", pytest.param("Robotiq 2F-85", marks=pytest.mark.long)])
def test_both_sides_of_another_hand_press_on_a_box(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    box = item("part", "box", kind.box, kind.at, 17.0)
    plan = planned(tmp_path, kind.urdf, ["pick: part"], box)
    state = run_by_clock(plan).states[-1]
    hand = plan.session.environment.hand
    assert hand is not None
    assert state.held is not None
    forces = {finger.finger: finger.force for finger in serialize.touch(hand, state).fingers}
    sides = hand.gripping_sides
    assert list(forces) == [part for side in sides for part in side]
    one, other = (sum(forces[part] for part in side) for side in sides)
    # Where the faces of the jaws are not parallel, friction balances the rest.
    assert one == pytest.approx(other, rel=0.25)
    assert 1.0 < one < 1.1 * FINGER_FORCE
