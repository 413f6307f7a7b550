"""The extension ``water``: the water of the state in the scene."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.server.view.layer import ViewLayer


def _view_layer(_options: Namespace) -> ViewLayer:
    from katana450.extensions.water.nodes import WaterLayer

    return WaterLayer()


EXTENSION = Extension("water", serve=ServeExtension(view_layer=_view_layer))
