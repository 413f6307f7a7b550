"""The extension ``undo``: the request that undoes the last change."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.server.service.request_handler import RequestHandler


def _handler() -> type[RequestHandler]:
    from katana450.extensions.undo.undo_requests import UndoRequests

    return UndoRequests


EXTENSION = Extension("undo", serve=ServeExtension(handler=_handler))
