"""Private parts of viser whose change would show nowhere else: their names and limits.

The tests of our own server, which docs/viser.md names, fail for the others.
"""

from __future__ import annotations

import asyncio
import gzip
from typing import Any

import imageio.v3 as imageio
import msgspec
import numpy as np
import pytest
import viser
from viser import _messages as wire
from viser.infra._async_message_buffer import AsyncMessageBuffer

from katana450.server.viser_bridge import viser_page
from katana450.server.viser_bridge.frames import MAX_WINDOW
from katana450.server.viser_bridge.themes import LIGHT, set_sky
from tests.gateway.client import UPRIGHT
from tests.viser_bridge.internals import sent
from tests.viser_bridge.parts import part

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


async def test_frame_of_viser_holds_fewer_messages_than_one_of_ours() -> None:
    with part("max_window_size"):
        buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
        assert 0 < buffer.max_window_size < MAX_WINDOW


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


def test_page_is_packed_as_its_loader_unpacks_it() -> None:
    with part("client/build/index.html"):
        page = viser_page.load()
        assert page.html.content.count(b"<script") == 1
        program, decoder = (
            page.files[name] for name in (viser_page.PROGRAM, viser_page.DECODER_FILE)
        )
        assert gzip.decompress(program.packed) == program.content
        assert b"__viserZstdWasm" in program.content
        assert decoder.content.startswith(b"\0asm")
