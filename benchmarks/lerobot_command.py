"""Runs a command of LeRobot unchanged, in the environment of LeRobot.

The arguments are the name of the command without `lerobot-`, and its options.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

LIBRARIES: list[Any] = []
"""Objects that must live as long as the process."""


def define_operators() -> None:
    """Let torchvision be imported beside a torch of another version.

    torchvision for the processor only is not on PyPI. LeRobot uses no operator of it here, but
    torchvision refuses to be imported without this one.
    """
    library = import_module("torch").library.Library("torchvision", "DEF")
    library.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    LIBRARIES.append(library)


if __name__ == "__main__":
    define_operators()
    name = f"lerobot_{sys.argv[1]}"
    # LeRobot reads its options from the arguments after the name of the program.
    sys.argv[:2] = [name]
    import_module(f"lerobot.scripts.{name}").main()
