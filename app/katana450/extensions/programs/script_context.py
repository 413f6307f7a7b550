"""The settings that all steps of one script share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.extensions.programs.step_target import StepTarget


@dataclass(frozen=True)
class ScriptContext:
    """The settings that all steps of one script share.

    Attributes:
        in_base: whether its points are in the base frame, not in {S}.
        poses: its named places.
    """

    in_base: bool
    poses: Mapping[str, StepTarget]
