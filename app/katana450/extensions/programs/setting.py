"""What the steps of one script have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from katana450.extensions.programs.bench import Place


@dataclass(frozen=True)
class Setting:
    """What the steps of one script have in common.

    in_base: whether its points are in the base frame. poses: its places by name.
    """

    in_base: bool
    poses: Mapping[str, Place]
