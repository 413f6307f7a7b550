"""The extension ``hands``: which end of a gripper is closed, and what it closes against."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension

if TYPE_CHECKING:
    from katana450.arm.control.scene_objects import Hand
    from katana450.maths.collision.world import CollisionWorld


def _hand(world: CollisionWorld, hand: Hand) -> Hand:
    from katana450.extensions.hands.sides import with_sides

    return with_sides(world, hand)


EXTENSION = Extension("hands", hand=_hand)
