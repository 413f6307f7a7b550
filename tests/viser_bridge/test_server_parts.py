"""Each private part of viser's server that the app uses, tested on a real server."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress
from typing import Any

import imageio.v3 as imageio
import msgspec
import numpy as np
import pytest
import viser
import zstandard
from viser import _messages as wire
from viser.infra import _infra
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from katana450.server.viser_bridge import viser_page
from katana450.server.viser_bridge.frames import MAX_WINDOW
from katana450.server.viser_bridge.proxy import SUBPROTOCOL
from katana450.server.viser_bridge.recording_page import TITLE, titled
from katana450.server.viser_bridge.themes import LIGHT, set_sky
from tests.gateway.client import UPRIGHT, Peer
from tests.viser_bridge.internals import sent
from tests.viser_bridge.parts import part

SECONDS = 10.0
"""Timeout [s] of every wait."""

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": UPRIGHT, "position": [1.0, 0.0, 1.0], "fov": 0.7,
    "near": 0.01, "far": 100.0, "image_height": 800, "image_width": 1280,
    "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip

RAY = {
    "ray_origin": [0.0, 0.0, 1.0], "ray_direction": [0.0, 0.0, -1.0], "screen_pos": [0.5, 0.5],
}  # fmt: skip

FROM_PAGE: dict[str, dict[str, Any]] = {
    "ViewerCameraMessage": CAMERA,
    "GuiUpdateMessage": {"uuid": "u", "updates": {"value": 0.5}},
    "TransformControlsUpdateMessage": {"name": "/n", "wxyz": UPRIGHT, "position": [0.0, 0.0, 0.0]},
    "TransformControlsDragStartMessage": {"name": "/n"},
    "TransformControlsDragEndMessage": {"name": "/n"},
    "SceneNodeClickMessage": {
        "name": "/n", "instance_index": None, "modifier": None, "owner": "", **RAY,
    },
}  # fmt: skip
"""Fields of each message that the app reads, as the page sends them."""


@asynccontextmanager
async def browser(
    server: viser.ViserServer, subprotocol: Subprotocol = SUBPROTOCOL
) -> AsyncIterator[ClientConnection]:
    async with connect(
        f"ws://127.0.0.1:{server.get_port()}",
        subprotocols=[subprotocol],
        additional_headers={"X-Test": "here"},
        compression=None,
        max_size=None,
    ) as socket:
        yield socket


async def until(condition: Callable[[], object], what: str) -> None:
    async with asyncio.timeout(SECONDS):
        while not condition():
            await asyncio.sleep(0.01)
    assert condition(), what


def run(trial: Coroutine[Any, Any, None]) -> None:
    asyncio.run(trial)


def test_server_has_a_websocket_server(server: viser.ViserServer) -> None:
    with part("_websock_server"):
        assert isinstance(server._websock_server, _infra.WebsockServer)


async def test_handler_of_the_server_can_be_replaced(server: viser.ViserServer) -> None:
    with part("_handle_incoming_message"):
        received: list[tuple[Any, Any]] = []
        websocket = server._websock_server
        pass_on = websocket._handle_incoming_message

        async def handle(client_id: Any, message: Any) -> None:
            received.append((client_id, message))
            await pass_on(client_id, message)

        websocket._handle_incoming_message = handle  # type: ignore[method-assign]
        async with browser(server) as socket:
            await socket.send(msgspec.msgpack.encode(CAMERA))
            await until(server.get_clients, "a client for the first camera")
            ((client_id, message),) = received
            assert isinstance(message, wire.ViewerCameraMessage)
            assert client_id in server.get_clients()


async def test_handler_of_a_connection_can_be_replaced(server: viser.ViserServer) -> None:
    with part("_handle_incoming_message"):
        received: list[Any] = []

        async def handle(_client_id: Any, message: Any) -> None:
            received.append(message)

        def meet(connection: Any) -> None:
            connection._handle_incoming_message = handle

        server._websock_server.on_client_connect(meet)
        async with browser(server) as socket:
            await socket.send(msgspec.msgpack.encode(CAMERA))
            await until(lambda: received, "the message")


async def test_first_callback_of_a_connection_comes_before_any_frame(
    server: viser.ViserServer,
) -> None:
    with part("_client_connect_cb"):
        websocket = server._websock_server

        async def refuse(connection: Any) -> None:
            await websocket._live_connections[connection.client_id].close(1008)

        websocket._client_connect_cb.insert(0, refuse)
        async with browser(server) as socket:
            with pytest.raises(ConnectionClosed) as closed:
                await asyncio.wait_for(socket.recv(), SECONDS)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 1008


async def test_request_of_a_connection_can_be_read(server: viser.ViserServer) -> None:
    with part("_live_connections"):
        named: list[str] = []
        ended: list[int] = []
        websocket = server._websock_server

        def meet(connection: Any) -> None:
            request = websocket._live_connections[connection.client_id].request
            named.append(request.headers["X-Test"] if request else "no request")

        websocket.on_client_connect(meet)
        websocket.on_client_disconnect(lambda connection: ended.append(connection.client_id))
        async with browser(server):
            await until(lambda: named, "the connection")
        assert named == ["here"]
        await until(lambda: ended, "the end of the connection")


def test_producer_of_frames_can_be_replaced(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.scene.add_frame("/frame")
    received: list[str] = []
    sizes: list[int] = []

    async def produce(
        line: Any, buffer: Any, client_id: int, backlog_done_message: Any = None
    ) -> None:
        assert line.request.headers["X-Test"] == "here"
        sizes.append(buffer.max_window_size)
        windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
        try:
            async for window in windows:
                received.extend(type(message).__name__ for message in window)
        finally:
            await windows.aclose()

    async def trial() -> None:
        monkeypatch.setattr(_infra, "_message_producer", produce)
        async with browser(server):
            await until(lambda: "ReplayDoneMessage" in received, "the scene")
        assert "FrameMessage" in received
        # More than a scene may have in one frame is sent in parts.
        assert all(0 < size < MAX_WINDOW for size in sizes)

    with part("_message_producer"), part("window_generator"), part("max_window_size"):
        run(trial())


def test_consumer_of_messages_can_be_replaced(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    handled: list[tuple[int, str]] = []
    own = _infra._message_consumer

    async def handle(client_id: Any, message: Any) -> None:
        handled.append((int(client_id), type(message).__name__))

    async def consume(line: Any, pass_on: Any, message_class: Any) -> None:
        assert line.request.headers["X-Test"] == "here"
        pass_on(wire.TransformControlsDragStartMessage("/n"))
        await own(line, pass_on, message_class)

    async def trial() -> None:
        monkeypatch.setattr(_infra, "_message_consumer", consume)
        monkeypatch.setattr(server._websock_server, "_handle_incoming_message", handle)
        async with browser(server) as socket:
            await socket.send(msgspec.msgpack.encode(CAMERA))
            await until(lambda: len(handled) == 2, "both messages")

    with part("_message_consumer"), part("_handle_incoming_message"):
        run(trial())
    assert [name for _, name in handled] == [
        "TransformControlsDragStartMessage",
        "ViewerCameraMessage",
    ]


async def test_message_for_one_browser_reaches_it_alone(server: viser.ViserServer) -> None:
    with part("queue_message"):
        connections: list[Any] = []
        server._websock_server.on_client_connect(connections.append)
        async with browser(server) as one, browser(server) as other:
            await until(lambda: len(connections) == 2, "both")
            connections[0].queue_message(wire.SetPositionMessage("/only", (0.0, 0.0, 0.0)))
            received = [await Peer(socket).listen() for socket in (one, other)]
        named = [
            [message for message in messages if message.get("name") == "/only"]
            for messages in received
        ]
        assert sorted(map(len, named)) == [0, 1]


def test_control_is_found_by_its_id(server: viser.ViserServer) -> None:
    slider = server.gui.add_slider("S", min=0.0, max=1.0, step=0.1, initial_value=0.0)
    with part("_gui_input_handle_from_uuid"):
        (control,) = (
            message for message in sent(server) if isinstance(message, wire.GuiSliderMessage)
        )
        assert server.gui._gui_input_handle_from_uuid.get(control.uuid) is slider
        assert server.gui._gui_input_handle_from_uuid.get("none") is None


def test_state_of_a_node_can_be_written_and_sent(server: viser.ViserServer) -> None:
    frame: Any = server.scene.add_frame("/frame")
    with part("_impl"):
        frame._impl.wxyz, frame._impl.position = np.array(UPRIGHT[::-1]), np.ones(3)
        np.testing.assert_array_equal(frame.wxyz, UPRIGHT[::-1])
        np.testing.assert_array_equal(frame.position, np.ones(3))
        assert frame._impl.props.show_axes == frame.show_axes
    with part("_queue_scene_message"):
        frame._impl.api._queue_scene_message(wire.SetPositionMessage("/frame", (1.0, 2.0, 3.0)))
        (message,) = (
            queued for queued in sent(server) if isinstance(queued, wire.SetPositionMessage)
        )
        assert message.position == (1.0, 2.0, 3.0)


@pytest.mark.parametrize("kind", FROM_PAGE)
def test_message_of_the_page_is_decoded(kind: str) -> None:
    fields = {"type": kind, **FROM_PAGE[kind]}
    with part("Message.deserialize"), part(kind):
        message = wire.Message.deserialize(msgspec.msgpack.encode(fields))
        assert type(message).__name__ == kind
        for name, value in FROM_PAGE[kind].items():
            if name == "type":
                continue
            decoded = getattr(message, name)
            assert (list(decoded) if isinstance(decoded, tuple) else decoded) == value, name


@pytest.mark.parametrize(
    ("kind", "arguments", "fields"),
    [
        ("SetOrientationMessage", ("/n", (1.0, 0.0, 0.0, 0.0)), {"wxyz": (1.0, 0.0, 0.0, 0.0)}),
        ("SetPositionMessage", ("/n", (1.0, 2.0, 3.0)), {"position": (1.0, 2.0, 3.0)}),
        ("SetSceneNodeVisibilityMessage", ("/n", False), {"visible": False}),
        ("SceneNodeUpdateMessage", ("/n", {"visible": False}), {"updates": {"visible": False}}),
    ],
)
def test_message_of_ours_is_packed(
    kind: str, arguments: tuple[Any, ...], fields: dict[str, Any]
) -> None:
    with part("as_serializable_dict"), part(kind):
        packed = getattr(wire, kind)(*arguments).as_serializable_dict([])
        assert packed["type"] == kind
        assert packed["name"] == "/n"
        assert {name: packed[name] for name in fields} == fields


def test_sky_is_sent_as_viser_sends_an_image(server: viser.ViserServer) -> None:
    def sent_last() -> Any:
        return next(message for message in reversed(sent(server)) if hasattr(message, "rgb_data"))

    with part("BackgroundImageMessage"):
        set_sky(server, LIGHT)
        ours = sent_last()
        pixels = imageio.imread(ours.rgb_data, extension=".png")
        np.testing.assert_array_equal(pixels[[0, -1]], [[LIGHT.sky] * 2, [LIGHT.floor] * 2])
        server.scene.set_background_image(pixels, format="png")
        visers = sent_last()
        assert visers is not ours
        assert (visers.format, visers.depth_data) == (ours.format, ours.depth_data)
        np.testing.assert_array_equal(imageio.imread(visers.rgb_data, extension=".png"), pixels)


def test_arrays_of_a_message_are_taken_out_of_it() -> None:
    arrays: list[memoryview] = []
    with part("as_serializable_dict"):
        updates = {"batched_wxyzs": np.zeros((2, 4), np.float32)}
        wire.SceneNodeUpdateMessage("/n", updates).as_serializable_dict(arrays)
        assert [array.nbytes for array in arrays] == [32]


async def test_only_the_own_subprotocol_is_answered(server: viser.ViserServer) -> None:
    with part("viser-v{version}"):
        async with browser(server) as socket:
            assert await asyncio.wait_for(socket.recv(), SECONDS)
        with suppress(ConnectionClosed):
            async with browser(server, Subprotocol("viser-v0.0.1")) as socket:
                await asyncio.wait_for(socket.recv(), SECONDS)
                pytest.fail("a page of another version was served")


async def test_frames_are_built_as_ours_and_the_scene_ends_with_a_mark(
    server: viser.ViserServer,
) -> None:
    server.scene.add_frame("/frame")
    with part("frame"):
        async with browser(server) as socket:
            messages = await Peer(socket).listen()
        kinds = [message["type"] for message in messages]
        assert "FrameMessage" in kinds
        assert kinds[-1] == "ReplayDoneMessage"


def test_page_is_packed_as_its_loader_unpacks_it() -> None:
    with part("client/build/index.html"):
        page = viser_page.load()
        assert page.html.content.count(b"<script") == 1
        program, decoder = (
            page.files[name] for name in (viser_page.PROGRAM, viser_page.DECODER_FILE)
        )
        assert program.zstd is not None
        assert zstandard.decompress(program.zstd) == program.content
        assert b"__viserZstdWasm" in program.content
        assert decoder.content.startswith(b"\0asm")


def test_page_of_a_recording_has_the_title_that_is_replaced(server: viser.ViserServer) -> None:
    with part("<title>Viser</title>"):
        page = server.get_scene_serializer().as_html()
        assert page.count(TITLE) == 1
        changed = titled(page, "A <run>", "A </script>")
        assert "<title>A &lt;run&gt;</title>" in changed
        assert "A </script>" not in changed
