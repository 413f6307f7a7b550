"""HTTP uploads of meshes and scenes, read outside of the server's thread."""

from __future__ import annotations

import asyncio
import hashlib
import threading
from collections.abc import Awaitable, Callable
from typing import TypeVar

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import CommandChannel
from katana450.arm.robot.object_meshes import Mesh
from katana450.errors import CancelledError, InputError, LeaseError
from katana450.extensions.importers.archive import MAX_ARCHIVE_BYTES, ChoiceError
from katana450.extensions.importers.formats.mesh_file import read_mesh
from katana450.extensions.importers.formats.scene_file import StoredScene, read_scene_zip, scene_zip
from katana450.extensions.importers.formats.shape_file import LONGEST_NAME, Format
from katana450.extensions.objects.scenes import free_name, scenes_of, used_in
from katana450.extensions.programs.script.script_scene import Scene
from katana450.maths.planning.checkpoint import checked_by
from katana450.maths.water.units import MILLILITRE, ML
from katana450.server.api import answers
from katana450.server.api.fields import ROOT
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.hub import Hub
from katana450.server.service.limits import ConnectionLimit, SenderBuckets
from katana450.server.service.participants import actor_of
from katana450.server.web.admission import client_of, reserved
from katana450.server.web.bodies import (
    NOT_NOW,
    NOT_UNDERSTOOD,
    TOO_MANY,
    TOO_SLOW,
    as_json,
    body_of,
)
from katana450.server.web.http_api import RouteContext


def keep_mesh(hub: Hub, mesh: Mesh) -> answers.Mesh:
    """Store ``mesh``, so that it can be placed. Raises InputError if there is no room for it."""
    state = None if hub.arm is None else hub.arm.state
    hub.meshes.put([mesh], used_in(state))
    names = {scene_object.name for scene_object in state.objects} if state is not None else set()
    return answers.Mesh(
        key=mesh.key,
        name=free_name(mesh.name, names),
        text=mesh.text,
        size=list(mesh.solid.size),
        triangles=len(mesh.faces),
        scale=mesh.scale,
    )


def keep_scene(hub: Hub, data: bytes, stored: StoredScene, arm: ArmHandle) -> answers.Scene:
    """Store ``stored``, read from ``data``, so that it can be loaded. Raises InputError."""
    key = hashlib.sha256(data).hexdigest()[:32]
    scene = stored.scene
    scenes_of(hub).keep(key, cmd.ReplaceScene(scene.objects, scene.water), stored.meshes, arm)
    names = [scene_object.name for scene_object in scene.objects]
    text = f"{len(names)} object{'' if len(names) == 1 else 's'}: {', '.join(names) or 'none'}."
    if scene.joints is not None:
        text += " The arm does not move."
    return answers.Scene(key=key, objects=names, text=text)


def zipped(hub: Hub, arm: ArmHandle) -> bytes:
    """Return the present scene as a .zip. Raises InputError or LeaseError if it cannot be saved."""
    hand = arm.environment.hand
    return scene_zip(_stored(hub, arm), None if hand is None else hand.T_palm_tool)


def _stored(hub: Hub, arm: ArmHandle) -> StoredScene:
    state = arm.state
    held = state.held
    if held is not None:
        raise LeaseError(
            f"{held.name!r} is held. Set it down first: a scene cannot have held objects."
        )
    water = None
    if state.poured is not None:
        water = ML * state.poured.water.cup.volume / MILLILITRE
    keys = dict.fromkeys(t.solid.key for t in state.objects if t.solid is not None)
    meshes = tuple(hub.meshes.need(key) for key in keys)
    return StoredScene(Scene(state.objects, water, state.q), meshes)


RATE, UPLOAD_BURST = 0.5, 10.0
"""Uploads per second, and maximum burst, of one identity."""

MAX_SENDERS = 256
"""Maximum number of identities whose uploads are counted."""

WAITING, WAITING_EACH, RESERVED = 4, 2, 1
"""Maximum number of uploads in progress or waiting, of all clients and of one identity, and number
reserved for the driver and for each admin."""

UPLOAD_TIMEOUT = 60.0
"""[s] Timeout of receiving and reading a file."""

MIN_RATE = 20_000.0
"""Minimum mean rate of an upload [bytes/s], so that nobody keeps a place by dripping."""

T = TypeVar("T")


class Uploads:
    """The HTTP routes for files. An upload is stored for a while, under a key."""

    def __init__(self, context: RouteContext) -> None:
        """Prepare the routes."""
        self._context, self._hub = context, context.hub
        self._often = SenderBuckets(RATE, UPLOAD_BURST, MAX_SENDERS)
        self._reading = asyncio.Lock()
        self._places = ConnectionLimit(WAITING, WAITING_EACH)

    def routes(self) -> list[BaseRoute]:
        """Return all routes."""
        return [
            Route(f"{ROOT}/mesh", self._mesh, methods=["POST"]),
            Route(f"{ROOT}/scene", self._load, methods=["POST"]),
            Route(f"{ROOT}/scene", self._save, methods=["GET"]),
        ]

    async def _mesh(self, request: Request) -> Response:
        query = request.query_params
        name, unit, main = query.get("name", ""), query.get("unit"), query.get("main", "")

        async def keep() -> answers.Answer:
            if max(len(name), len(main) // 4) > 4 * LONGEST_NAME:
                raise InputError("The name of the file is too long.")
            if not main.isprintable():
                raise InputError("`main` is not a path in the .zip.")
            data = await body_of(request, Format.of(name).max_bytes, UPLOAD_TIMEOUT, MIN_RATE)
            mesh = await self._in_thread(
                request, lambda: read_mesh(data, name, unit or None, main=main)
            )
            return keep_mesh(self._hub, mesh)

        return await self._answered(request, keep)

    async def _load(self, request: Request) -> Response:
        async def keep() -> answers.Answer:
            arm = self._hub.present()
            data = await body_of(request, MAX_ARCHIVE_BYTES, UPLOAD_TIMEOUT, MIN_RATE)
            hand = arm.environment.hand
            T_palm_tool = None if hand is None else hand.T_palm_tool
            stored = await self._in_thread(request, lambda: read_scene_zip(data, T_palm_tool))
            return keep_scene(self._hub, data, stored, arm)

        return await self._answered(request, keep)

    async def _save(self, request: Request) -> Response:
        self._context.identity(request)
        try:
            arm = self._hub.present()
            content = await asyncio.to_thread(zipped, self._hub, arm)
        except (InputError, LeaseError) as error:
            return as_json(answers.Refused(why=str(error)), NOT_NOW)
        headers = {"Content-Disposition": 'attachment; filename="scene.zip"'}
        return Response(content, media_type="application/zip", headers=headers)

    async def _answered(
        self, request: Request, keep: Callable[[], Awaitable[answers.Answer]]
    ) -> Response:
        """Return the answer of ``keep`` as a response, if role and limits allow the upload."""
        sender = self._context.driver(request, "upload files")
        what = {"path": request.url.path, "name": request.query_params.get("name")}
        self._hub.recorder.note("upload", actor_of(sender, CommandChannel.HTTP), what)
        client = client_of(self._context.authenticator, request)
        assert client is not None
        places = reserved(self._hub, self._context.authenticator, client, RESERVED)
        with self._places.taken(client.session, places) as free:
            if not free or not self._often.take(client.session, self._hub.clock()):
                why = "Too many files at once. Wait a moment."
                self._hub.recorder.refuse(
                    "upload", actor_of(sender, CommandChannel.HTTP), InputError(why)
                )
                return as_json(answers.Refused(why=why), TOO_MANY)
            try:
                async with asyncio.timeout(UPLOAD_TIMEOUT):
                    return as_json(await keep())
            except TimeoutError:
                why = f"The upload took more than {UPLOAD_TIMEOUT:g} s."
                return as_json(answers.Refused(why=why), TOO_SLOW)
            except ChoiceError as error:
                refused = answers.Refused(why=str(error), choices=list(error.choices))
                return as_json(refused, NOT_UNDERSTOOD)

    async def _in_thread(self, request: Request, read: Callable[[], T]) -> T:
        """Return the result of ``read``, run in a thread, or cancel it if the client leaves.

        One at a time: each may take a process and a gigabyte.
        """
        cancelled = threading.Event()

        def check() -> None:
            if cancelled.is_set():
                raise CancelledError("The upload was cancelled.")

        def checked() -> T:
            with checked_by(check):
                return read()

        async with self._reading:
            reading = asyncio.create_task(asyncio.to_thread(checked))
            disconnection = asyncio.create_task(_disconnected(request))
            try:
                await asyncio.wait((reading, disconnection), return_when=asyncio.FIRST_COMPLETED)
            finally:
                cancelled.set()
                disconnection.cancel()
                # The next file is read after this thread has ended, at its next checkpoint.
                await asyncio.wait((reading,))
            return reading.result()


async def _disconnected(request: Request) -> None:
    """Wait until the client of ``request``, which is read to its end, has left."""
    while (await request.receive())["type"] != "http.disconnect":
        pass
