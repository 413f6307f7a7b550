"""The extension ``objects``: the requests that place, change and remove scene objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension, ServeExtension

if TYPE_CHECKING:
    from katana450.server.service.request_handler import RequestHandler


def _handler() -> type[RequestHandler]:
    from katana450.extensions.objects.object_requests import ObjectRequests

    return ObjectRequests


EXTENSION = Extension("objects", serve=ServeExtension(handler=_handler))
