"""The viser server, on a port of its own that only the gateway may use."""

from __future__ import annotations

import contextlib
import io
import secrets
from typing import Any

import viser

from katana450.server.viser_bridge import frames
from katana450.server.viser_bridge.brand import dress
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset

KEY_HEADER = "X-Katana450-Key"
"""Header in which the gateway shows the key."""


def open_server(key: str) -> viser.ViserServer:
    """A viser server on a free port of this machine alone, its scene still empty.

    viser asks nobody who they are, and any program and any web page on this machine can reach a
    port of it; so whoever connects without ``key`` is sent away before anything is said.
    """
    frames.share()
    # What viser prints of itself here would stand between a person and our own line.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, label="Katana450", verbose=False)
    _Lock(server, key)
    _dress(server)
    return server


def close_server(server: viser.ViserServer) -> None:
    """Close it, without viser's own words of goodbye."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


class _Lock:
    """Lets in those who have the key.

    The hook is no public interface of viser's: its version is exact, and tests knock at the port.
    """

    def __init__(self, server: viser.ViserServer, key: str) -> None:
        self._key = key
        self._friends: set[int] = set()
        self._websocket = server._websock_server
        handle = self._websocket._handle_incoming_message

        async def guarded(client_id: Any, message: Any) -> None:
            if client_id in self._friends:
                await handle(client_id, message)

        self._websocket._handle_incoming_message = guarded  # type: ignore[method-assign]
        # Before viser's own, so that a stranger is closed before it is sent anything.
        self._websocket._client_connect_cb.insert(0, self._meet)
        self._websocket.on_client_disconnect(
            lambda connection: self._friends.discard(connection.client_id)
        )

    async def _meet(self, connection: Any) -> None:
        line = self._websocket._live_connections[connection.client_id]
        shown = line.request.headers.get(KEY_HEADER, "") if line.request else ""
        if secrets.compare_digest(shown.encode(), self._key.encode()):
            self._friends.add(connection.client_id)
            return
        # What it has sent already would still be read.
        connection._handle_incoming_message = _ignore
        await line.close(1008, "Not here: the page is at another port.")


async def _ignore(_client_id: Any, _message: Any) -> None:
    return


def _dress(server: viser.ViserServer) -> None:
    """What a page takes over when it connects, and so must stand before the first one does."""
    dress(server.gui)
    server.gui.set_panel_label("Katana450")
    server.gui.main_panel.dock_right()
    server.scene.set_up_direction("+z")
    look = CAMERA_POSES[Preset.FREE]
    server.initial_camera.position = look.position
    server.initial_camera.look_at = look.target
    server.initial_camera.fov = FOV
