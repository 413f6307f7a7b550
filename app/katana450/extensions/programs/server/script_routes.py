"""Scripts over HTTP, for the page: the list, one text, reading a text, and saving it."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import msgspec
import numpy as np
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.arm import NO_GRIPPER, GripperModel
from katana450.arm.control.lease import CommandChannel
from katana450.errors import InputError
from katana450.extensions.programs.language.source import MAX_BYTES, Problem, ScriptError, read
from katana450.extensions.programs.script.blocks import TextBlock, blocks_of
from katana450.extensions.programs.script.script import examples, parse, script_of, script_schema
from katana450.extensions.programs.script.script_files import Scripts
from katana450.extensions.programs.script.teach import DIGITS, taught
from katana450.server.api.fields import ROOT
from katana450.server.service.limits import BoundedWork
from katana450.server.service.participants import actor_of
from katana450.server.web.bodies import NOT_NOW, NOT_UNDERSTOOD, as_json, body_of
from katana450.server.web.http_api import RouteContext

MAX_WAITING = 8
"""Maximum number of texts that wait to be read; reading a long one takes most of a second."""


class ScriptRoutes:
    """The HTTP routes of scripts."""

    def __init__(self, context: RouteContext, scripts: Scripts) -> None:
        """Serve ``scripts`` to the clients of ``context``."""
        self._context = context
        self._scripts = scripts
        self._work = BoundedWork(1, MAX_WAITING, "Too many scripts at once. Wait a moment.")

    def routes(self) -> list[BaseRoute]:
        """Return all routes."""
        return [
            Route(f"{ROOT}/script.schema.json", self._schema),
            Route(f"{ROOT}/scripts", self._list),
            Route(f"{ROOT}/scripts", self._read, methods=["POST"]),
            Route(f"{ROOT}/scripts/{{name}}", self._text),
            Route(f"{ROOT}/scripts/{{name}}", self._save, methods=["POST"]),
        ]

    async def _list(self, request: Request) -> Response:
        """Return the names of scripts for this arm, whether there is a folder, and examples."""
        self._context.identity(request)
        arm = self._context.hub.arm
        model = None if arm is None else arm.robot.arm
        names = await asyncio.to_thread(self._scripts.offered, model)
        fingers = arm is None or (model or arm.robot.joint_group).gripper.moves
        steps = examples(fingers=fingers)
        return as_json({"names": names, "saves": self._scripts.keeps, "steps": steps})

    async def _schema(self, _request: Request) -> Response:
        """Return the JSON Schema of scripts, which holds nothing of this server."""
        return Response(_schema_json(), media_type="application/schema+json")

    async def _text(self, request: Request) -> Response:
        self._context.identity(request)
        try:
            text = await asyncio.to_thread(self._scripts.text, request.path_params["name"])
        except InputError as error:
            raise HTTPException(404, str(error)) from error
        return PlainTextResponse(text)

    async def _read(self, request: Request) -> Response:
        """Return problems of a text by line, its blocks if it is YAML, and its poses if all are."""
        arm = self._context.hub.arm
        names: dict[str, Iterable[str]] = {}
        axes: dict[str, list[float]] = {}
        gripper = NO_GRIPPER
        if arm is not None:
            mounted = arm.robot.arm
            model = mounted or arm.robot.joint_group
            gripper, limits = model.gripper, model.limits
            ends = np.degrees((limits.lower, limits.upper)).T.round(DIGITS).tolist()
            names["axes"] = axes = dict(zip(arm.robot.joint_labels, ends, strict=True))
            names["objects"] = [body.name for body in arm.state.objects]
            names["tools"] = () if mounted is None else mounted.tools
            names["unsuited"] = ("yaw",) if mounted and mounted.kinematics.is_pitched else ()

        def reading(text: str) -> Response:
            answer: dict[str, Any] = {"problems": (), "taught": None, "blocks": None}
            try:
                value = read(text)
                blocks = blocks_of(value, text, names)
                answer["blocks"] = [_as_shown(block, gripper) for block in blocks]
                answer["taught"] = taught(script_of(value))
                answer["problems"] = tuple(_beyond(blocks, axes))
            except ScriptError as error:
                answer["problems"] = error.problems
            return as_json(answer)

        return await self._with_text(request, reading)

    async def _save(self, request: Request) -> Response:
        """Save a text that is a valid script in the folder; ``?replace`` replaces an old one."""
        name = request.path_params["name"]
        sender = self._context.identity(request)

        def save(text: str) -> Response:
            parse(text)
            try:
                self._scripts.save(name, text, replaces="replace" in request.query_params)
            except InputError as error:
                raise HTTPException(NOT_NOW, str(error)) from error
            return Response(status_code=204)

        answer = await self._with_text(request, save)
        if answer.status_code == 204:
            actor = actor_of(sender, CommandChannel.HTTP)
            self._context.hub.recorder.note("script", actor, {"saved": name})
        return answer

    async def _with_text(self, request: Request, act: Callable[[str], Response]) -> Response:
        """Return the answer of ``act`` to the text in the body of ``request``, run in a thread."""
        if not self._context.identity(request).role.may_drive:
            raise HTTPException(403, "You may watch, not drive.")
        data = await body_of(request, MAX_BYTES)
        try:
            text = data.decode()
        except UnicodeDecodeError as error:
            raise HTTPException(NOT_UNDERSTOOD, "The script is not UTF-8 text.") from error
        return await self._work.result(lambda: act(text))


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes of the scripts of the library and of the folder of ``--programs``."""
    folder = getattr(context.options, "programs", None)
    return ScriptRoutes(context, Scripts(folder)).routes()


def _as_shown(block: TextBlock, gripper: GripperModel) -> TextBlock:
    """Return ``block`` with a place of the fingers in percent, as the panel shows it."""
    place = block.values[0] if block.values else None
    if place is None or place.name != "gripper" or not (place.step and gripper.moves):
        return block
    angle = float(place.text) * (1e-3 if gripper.slides else math.radians(1.0))
    opening = 100.0 * (angle - gripper.closed) / (gripper.opened - gripper.closed)
    return replace(block, title=block.title.replace(place.text, f"{opening:.1f} %"))


def _beyond(blocks: Iterable[TextBlock], axes: Mapping[str, Sequence[float]]) -> Iterator[Problem]:
    """Yield the angles in ``blocks`` that are beyond the ends of their ``axes`` [deg]."""
    for value in (value for block in blocks if block.enabled for value in block.values):
        if value.step and not value.before and value.name in axes:
            low, high = axes[value.name]
            if not low <= float(value.text) <= high:
                why = f"{value.text} is not between {low:g} and {high:g} deg."
                yield Problem(value.line, value.column, why)


@cache
def _schema_json() -> bytes:
    return msgspec.json.encode(script_schema())
