"""The extension ``ellipsoid``: the velocity ellipsoid in the scene."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.server.view.layer import ViewLayer


def _view_layer(_options: Namespace) -> ViewLayer:
    from katana450.extensions.ellipsoid.layer import EllipsoidLayer

    return EllipsoidLayer()


EXTENSION = Extension("ellipsoid", serve=ServeExtension(view_layer=_view_layer))
