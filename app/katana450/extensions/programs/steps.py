"""The steps a script can have, by their names.

Another kind is a class beside these, with `read` and `lay` as `Step` has them, and its name here.
"""

from __future__ import annotations

from katana450.extensions.programs.grasp import Grasp
from katana450.extensions.programs.manner import Gripper, Pause, Speed, Tool
from katana450.extensions.programs.moves import Home, Joints, Move, Via
from katana450.extensions.programs.pouring import Pour
from katana450.extensions.programs.set_down import SetDown
from katana450.extensions.programs.step import Step
from katana450.extensions.programs.table import Fill, Put
from katana450.extensions.programs.tool_moves import Arc, Circle, Line, Lines, Screw

STEPS: dict[str, type[Step]] = {
    "move": Move,
    "joints": Joints,
    "home": Home,
    "via": Via,
    "line": Line,
    "lines": Lines,
    "arc": Arc,
    "circle": Circle,
    "screw": Screw,
    "gripper": Gripper,
    "wait": Pause,
    "tool": Tool,
    "speed": Speed,
    "fill": Fill,
    "put": Put,
    "grasp": Grasp,
    "pour": Pour,
    "set_down": SetDown,
}
