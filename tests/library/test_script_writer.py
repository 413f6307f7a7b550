"""A script that is written in Python says what its YAML says."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np
import pytest

import katana450
from katana450.extensions.programs.building.step import count
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import script_text
from katana450.extensions.programs.steps.steps import STEPS
from tests.programs.yaml_core import loaded

ALL = """\
name: All
about: Every step once.
gripper: fitted
frame: base
tool: tcp
speed: 0.5
poses:
  corner: {x: 320, y: -40, z: 150, pitch: 50, roll: 0}
  folded: {joints: [0, -68, 85, 8, 0]}
steps:
- home
- joints: [0, -68, 85, 8, 0]
- nudge: {axis: 5, by: 0.2 rad}
- move: corner
- move: {x: 1, y: 2, z: 3, pitch: 40, branch: front-up}
- via: {through: [corner, folded], blend: 0.4}
- line: {to: corner, pitch: 45}
- line: {by: [0, 10, 0]}
- lines: {through: [corner, {x: 1, y: 2, z: 3}], blend: 0}
- arc: {centre: corner, axis: z, angle: 20, climb: 5}
- circle: {centre: [320, 0, 150], normal: x, radius: 20, turns: 2, pitch: roomiest}
- trajectory:
    through:
    - [0, 0, -68, 85, 8, 0]
    - [0.5, 5, -68, 85, 8, 0]
- gripper: open
- gripper: {to: closed, holding: cup}
- wait: 0.5
- tool: grasp
- speed: 0.4
- put: {object: cup, x: 300, y: 0}
- fill: 100
- grasp: {object: cup, pitch: 30}
- pour: {into: basin, shake: 2}
- set_down
- pour: {into: basin, ml: 50}
- pick: cup
- place: {at: {x: 300, y: 40, yaw: 20}, on: box}
- stack: {object: cup, on: box}
- release
- repeat:
    times: 2
    steps:
    - nudge: {axis: 1, by: 5}
    - repeat:
        times: 3
        steps:
        - home
expect:
  spilled_ml: {at_most: 0}
"""


def everything() -> katana450.ScriptWriter:
    with katana450.program(
        "All", about="Every step once.", gripper="fitted", frame="base", tool="tcp", speed=0.5
    ) as p:
        p.pose("corner", [320, -40, 150], pitch=50, roll=0)
        p.pose("folded", joints=(0, -68, 85, 8, 0))
        p.home()
        p.joints([0, -68, 85, 8, 0])
        p.nudge(5, "0.2 rad")
        p.move("corner")
        p.move(np.array([1, 2, 3]), pitch=40, branch="front-up")
        p.via(["corner", "folded"], blend=0.4)
        p.line("corner", pitch=45)
        p.line(by=(0, 10, 0))
        p.lines(["corner", {"x": 1, "y": 2, "z": 3}], blend=0)
        p.arc("corner", "z", 20, climb=5)
        p.circle((320, 0, 150), "x", 20, turns=2, pitch="roomiest")
        p.trajectory([[0, 0, -68, 85, 8, 0], [0.5, 5, -68, 85, 8, 0]])
        p.gripper("open")
        p.gripper("closed", holding="cup")
        p.wait(np.float64(0.5))
        p.tool("grasp")
        p.speed(0.4)
        p.put("cup", 300, 0)
        p.fill(100)
        p.grasp("cup", pitch=30)
        p.pour("basin", shake=2)
        p.set_down()
        p.pour("basin", ml=50)
        p.pick("cup")
        p.place({"x": 300, "y": 40, "yaw": 20}, on="box")
        p.stack("cup", on="box")
        p.release()
        with p.repeat(2):
            p.nudge(1, 5)
            with p.repeat(3):
                p.home()
        p.expect("spilled_ml", at_most=0)
    return p


def test_every_step_is_written_as_in_yaml() -> None:
    parse(ALL)
    assert loaded(str(everything())) == loaded(ALL)


def test_signature_and_documentation_are_those_of_the_step() -> None:
    signature = inspect.signature(katana450.ScriptWriter.pour)
    assert str(signature) == "(self, into, *, ml=None, shake=None)"
    text = inspect.getdoc(katana450.ScriptWriter.nudge) or ""
    assert text.startswith("Turn one joint by an angle.")
    assert "Args:\n    axis: Number of the joint, from 1." in text
    with pytest.raises(TypeError, match="by"):
        katana450.ScriptWriter({}).nudge(1)  # type: ignore[call-arg]


def test_there_is_a_method_for_every_step() -> None:
    assert [
        name for name in STEPS if not callable(getattr(katana450.ScriptWriter, name, None))
    ] == []


def test_alternatives_and_scenes_are_written(tmp_path: Path) -> None:
    with katana450.program() as p:
        p.scene([{"name": "a", "shape": "box", "size": [9, 9, 9], "pose": np.zeros(6)}])
        with p.when(volume={"of": "cup", "at_most": 9}):
            p.home()
            with p.when(held="a"):
                p.wait(2)
        with p.otherwise():
            p.wait(3)
    assert loaded(str(p))["steps"] == [
        {
            "if": {
                "volume": {"of": "cup", "at_most": 9},
                "then": ["home", {"if": {"held": "a", "then": [{"wait": 2}]}}],
                "else": [{"wait": 3}],
            }
        },
    ]
    p.save(tmp_path / "script.yaml")
    script = parse(script_text(tmp_path / "script.yaml"))
    assert script.scene is not None
    assert [entry.name for entry in script.scene.entries] == ["a"]
    assert count(script.steps) == 5
    with pytest.raises(katana450.InputError, match="must follow a block `when`"), p.otherwise():
        pass


def test_mistakes_are_reported_at_the_end_of_the_block() -> None:
    def wrong() -> None:
        with katana450.program() as p:
            p.move("nowhere")
            p.wait(-1)

    with pytest.raises(katana450.InputError, match="There is no pose 'nowhere'") as refused:
        wrong()
    assert "-1 is not between" in str(refused.value)


def test_error_in_the_block_is_not_replaced() -> None:
    with pytest.raises(ZeroDivisionError), katana450.program() as p:
        p.wait(1 / 0)


def test_what_cannot_be_written_is_refused_at_once() -> None:
    p = katana450.ScriptWriter({})
    with pytest.raises(katana450.InputError, match="needs three numbers"):
        p.move([1, 2])
    with pytest.raises(katana450.InputError, match="must be finite, not nan"):
        p.wait(float("nan"))
    with pytest.raises(katana450.InputError, match="list of steps"):
        p.check()
