"""The extension ``objects``: requests and controls that change scene objects."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.server.service.request_handler import RequestHandler
    from katana450.server.view.layer import ViewLayer
    from katana450.server.view.panel_folder import FolderContext, PanelFolder


def _handler() -> type[RequestHandler]:
    from katana450.extensions.objects.object_requests import ObjectRequests

    return ObjectRequests


def _folder(context: FolderContext) -> PanelFolder:
    from katana450.extensions.objects.objects_panel import ObjectsFolder

    return ObjectsFolder(context)


def _view_layer(_options: Namespace) -> ViewLayer:
    from katana450.extensions.objects.handles import HandlesLayer

    return HandlesLayer()


EXTENSION = Extension(
    "objects", serve=ServeExtension(view_layer=_view_layer, handler=_handler, folder=_folder)
)
