"""The links in the description of the arm."""

from __future__ import annotations

import itertools

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.client import Client
from katana450.server.api import answers


def test_each_joint_names_its_link_and_the_way_to_it(program: Client, robot: Robot) -> None:
    found = program.query(answers.Arm).links
    arm = robot.require_arm()
    by_name = {link.name: link for link in robot.links}
    assert [each.label for each in found][:2] == ["1 base turn", "2 shoulder"]
    for each, name in zip(found, arm.chain.names, strict=True):
        link = by_name[each.path[-1]]
        assert link.joint is not None
        assert (link.joint.name, by_name[each.path[0]].parent) == (name, None)
        assert np.allclose(each.axis, link.joint.axis)
        for above, below in itertools.pairwise(each.path):
            assert by_name[below].parent == above
