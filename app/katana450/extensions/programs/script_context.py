"""What the steps of one script have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.extensions.programs.plan_builder import StepTarget


@dataclass(frozen=True)
class ScriptContext:
    """What the steps of one script have in common.

    in_base: whether its points are in the base frame. poses: its places by name.
    """

    in_base: bool
    poses: Mapping[str, StepTarget]
