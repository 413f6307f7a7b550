"""The viser server, on a port of its own to which only the gateway may connect."""

from __future__ import annotations

import contextlib
import io
import secrets
from typing import Any

import viser

from katana450.server.viser_bridge import frames
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset

KEY_HEADER = "X-Katana450-Key"
"""Header in which the gateway sends the key."""

BRAND = (36, 119, 212)
"""Brand colour of the panel: red, green and blue, each from 0 to 255."""


def open_server(key: str) -> viser.ViserServer:
    """Open a viser server on a free local port, with an empty scene.

    viser does not authenticate its clients, and every program and web page on this machine can
    reach its port. A connection without ``key`` is therefore closed before anything is sent.
    """
    frames.share()
    # viser's own messages on the terminal would hide ours.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, label="Katana450", verbose=False)
    _Lock(server, key)
    _set_look(server)
    return server


def close_server(server: viser.ViserServer) -> None:
    """Close ``server`` without viser's own messages on the terminal."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


class _Lock:
    """Admits only connections with the key.

    The hook is a private part of viser, so its version is pinned, and tests connect to the port.
    """

    def __init__(self, server: viser.ViserServer, key: str) -> None:
        self._key = key
        self._admitted: set[int] = set()
        self._websocket = server._websock_server
        handle = self._websocket._handle_incoming_message

        async def guarded(client_id: Any, message: Any) -> None:
            if client_id in self._admitted:
                await handle(client_id, message)

        self._websocket._handle_incoming_message = guarded  # type: ignore[method-assign]
        # Before viser's own callback, so that nothing is sent to a connection without the key.
        self._websocket._client_connect_cb.insert(0, self._meet)
        self._websocket.on_client_disconnect(
            lambda connection: self._admitted.discard(connection.client_id)
        )

    async def _meet(self, connection: Any) -> None:
        line = self._websocket._live_connections[connection.client_id]
        shown = line.request.headers.get(KEY_HEADER, "") if line.request else ""
        if secrets.compare_digest(shown.encode(), self._key.encode()):
            self._admitted.add(connection.client_id)
            return
        # Messages that have already arrived would still be handled.
        connection._handle_incoming_message = _ignore
        await line.close(1008, "This port is internal. The page is at another port.")


async def _ignore(_client_id: Any, _message: Any) -> None:
    return


def _set_look(server: viser.ViserServer) -> None:
    """Set the look that a page takes over when it connects. Call it before the first connection."""
    server.gui.configure_theme(
        control_width="medium", show_logo=False, show_share_button=False, brand_color=BRAND
    )
    server.gui.set_panel_label("Katana450")
    server.gui.main_panel.dock_right()
    server.scene.set_up_direction("+z")
    look = CAMERA_POSES[Preset.FREE]
    server.initial_camera.position = look.position
    server.initial_camera.look_at = look.target
    server.initial_camera.fov = FOV
