"""The extension ``touch``: the forces between the fingers and what they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.arm.control.scene_objects import Hand
    from katana450.maths.collision.world import CollisionWorld
    from katana450.server.view.panel_folder import FolderContext, PanelFolder


def _hand(world: CollisionWorld, hand: Hand) -> Hand:
    from dataclasses import replace

    from katana450.arm.robot.props import load_props
    from katana450.extensions.touch.touch_model import touch_model

    model = touch_model(world, hand, {"cup": load_props().cup.mass})
    return replace(hand, grip_model=model)


def _folder(context: FolderContext) -> PanelFolder:
    from katana450.extensions.touch.pad_patches import PadPatches

    return PadPatches(context)


EXTENSION = Extension("touch", serve=ServeExtension(folder=_folder), hand=_hand)
