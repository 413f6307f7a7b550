"""The scene of the library: opened, moved, played, closed."""

from __future__ import annotations

import time
import urllib.request

import numpy as np
import pytest

import katana450


def angle_shown(viewer: katana450.Viewer) -> float:
    """Return the angle of axis 1 that was last sent to browsers [rad]."""
    return viewer._scenery.arm._joints[0].angle


def test_viewer_shows_postures_and_plans(shoulder_arm: katana450.Arm) -> None:
    q = np.array([0.7, -1.0, 1.4, 0.3, 0.0])
    with shoulder_arm.show(q) as viewer:
        with urllib.request.urlopen(viewer.url, timeout=10.0) as page:
            assert b"<html" in page.read()
        assert viewer.url in viewer._repr_html_()
        assert angle_shown(viewer) == 0.7
        plan = shoulder_arm.plan(q, [-0.7, *q[1:]])
        viewer.play(plan, speed=4.0)
        assert viewer._path.visible
        angles: set[float] = set()
        until = time.monotonic() + 30.0
        while len(angles) < 5 and time.monotonic() < until:
            angles.add(angle_shown(viewer))
            time.sleep(0.01)
        assert len(angles) >= 5
        viewer.move(shoulder_arm.ready)
        assert angle_shown(viewer) == shoulder_arm.ready[0]
        time.sleep(0.1)
        assert angle_shown(viewer) == shoulder_arm.ready[0]


def test_second_viewer_takes_the_next_port(shoulder_arm: katana450.Arm) -> None:
    with shoulder_arm.show() as one, shoulder_arm.show() as other:
        assert one.url != other.url


def test_unusable_input_opens_no_viewer(shoulder_arm: katana450.Arm) -> None:
    with pytest.raises(katana450.InputError, match="shape"):
        shoulder_arm.show([0.0])
    with shoulder_arm.show() as viewer:
        with pytest.raises(katana450.InputError, match="speed"):
            viewer.play(shoulder_arm.line(by=(0.0, 0.0, -0.02)), speed=0.0)
        with pytest.raises(katana450.InputError, match="shape"):
            viewer.move([0.0])
