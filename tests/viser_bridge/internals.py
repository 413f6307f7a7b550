"""Access of tests to viser's private parts, of which they use more than the app."""

from __future__ import annotations

from typing import Any

import viser
from viser import _messages as wire


def nodes(server: viser.ViserServer) -> dict[str, viser.SceneNodeHandle]:
    """Return the handles of the scene by their names."""
    return dict(server.scene._handle_from_node_name)


def controls(server: viser.ViserServer) -> list[Any]:
    """Return the handles of all controls that take an input."""
    return list(server.gui._gui_input_handle_from_uuid.values())


def panel(server: viser.ViserServer) -> list[Any]:
    """Return the handles of all elements of the panel, in its tabs and folders too."""
    containers: Any = server.gui._container_handle_from_uuid.values()
    return [handle for container in containers for handle in container._children.values()]


def sent(server: viser.ViserServer) -> list[Any]:
    """Return the messages for a browser that connects now."""
    return list(server._websock_server.get_message_buffer().message_from_id.values())


def outlet(server: viser.ViserServer) -> Any:
    """Return the object whose ``queue_message`` every message of the scene passes."""
    return server.scene._websock_interface


def value_change(handle: Any, value: object) -> wire.GuiUpdateMessage:
    """Return the message of a browser that sets a control to ``value``."""
    return wire.GuiUpdateMessage(handle._impl.uuid, {"value": value})


def drag(name: str, phase: str, *position: Any) -> Any:
    """Return the message of a browser for a ``phase`` of a drag: start, update or end."""
    if phase == "update":
        return wire.TransformControlsUpdateMessage(name, (1.0, 0.0, 0.0, 0.0), position)
    kinds = {
        "start": wire.TransformControlsDragStartMessage,
        "end": wire.TransformControlsDragEndMessage,
    }
    return kinds[phase](name)


def pretend_client(server: viser.ViserServer, client_id: int, client: Any) -> None:
    """Register ``client`` as the handle of a connected browser."""
    server._connected_clients[client_id] = client


def forget_clients(server: viser.ViserServer) -> None:
    """Remove the clients of `pretend_client`."""
    server._connected_clients.clear()
