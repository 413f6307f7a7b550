"""The routes of the list of robots, and of the upload of one."""

from __future__ import annotations

import asyncio
import re
from collections import Counter
from contextlib import suppress
from pathlib import Path

import msgspec
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.lease import CommandChannel
from katana450.errors import ConfigurationError
from katana450.extensions.gallery.arms_command import INCLUDED_ROBOTS, ListedRobot, listed_robots
from katana450.extensions.importers.archive import MAX_ARCHIVE_BYTES, ChoiceError
from katana450.extensions.robot_choice.robot_check import FIRST, first_robot
from katana450.extensions.robot_choice.uploaded_robots import keep_robot, uploaded_robots
from katana450.resources import INCLUDED, URDF_PATH
from katana450.server.api import answers
from katana450.server.api.fields import ROOT
from katana450.server.service.limits import TokenBucket
from katana450.server.service.participants import actor_of
from katana450.server.web.bodies import NOT_UNDERSTOOD, TOO_MANY, as_json, body_of
from katana450.server.web.http_api import RouteContext

UPLOAD_SECONDS, MIN_RATE = 60.0, 20_000.0
"""Timeout of an upload [s], and its minimum mean rate [bytes/s]."""

UPLOADS_PER_SECOND, BURST = 0.2, 5.0
"""Robots that are uploaded per second, and in a burst, by all people together."""

ARGUMENT = re.compile(rb"""<xacro:arg\s+name\s*=\s*["']([\w.-]+)["']([^>]*)""")
DEFAULT = re.compile(rb"""default\s*=\s*["']([^"']*)["']""")

MAX_ARGUMENTS = 20


class Choice(msgspec.Struct, frozen=True, omit_defaults=True):
    """A robot that can be chosen.

    Attributes:
        name: Its name in a request.
        title: Its name for people.
        maker: Its maker; empty if unknown.
        licence: Licence of the description; empty if unknown.
        kind: "included", "first" for that with which the server began, "uploaded", or "gallery" for
            an arm and "other" for another robot of the gallery, which may have to be downloaded.
        arguments: Arguments of a xacro file and their defaults.
    """

    name: str
    title: str
    kind: str
    maker: str = ""
    licence: str = ""
    arguments: dict[str, str] = {}


class Choices(msgspec.Struct, frozen=True):
    """The robots that can be chosen."""

    robots: list[Choice]


class Kept(msgspec.Struct, frozen=True):
    """The answer to an upload: the robot that is kept, to be chosen by its name."""

    robot: Choice


def choices(first: Path) -> list[Choice]:
    """Return the robots that can be chosen; ``first``: file of that with which the server began."""
    robots = [_listed(robot, "included") for robot in INCLUDED_ROBOTS.values()]
    if first not in INCLUDED.values():
        robots.append(Choice(FIRST, first.name, "first"))
    robots += (_uploaded(name, path) for name, path in uploaded_robots().items())
    # Without the extra there is no gallery.
    with suppress(ConfigurationError):
        listed = [robot for robot in listed_robots().values() if robot.urdf]
        titles = Counter(robot.robot for robot in listed)
        for robot in listed:
            alias = robot.alias or (robot.name if titles[robot.robot] > 1 else "")
            robots.append(_listed(robot, "gallery" if robot.is_arm else "other", alias))
    return robots


def _listed(robot: ListedRobot, kind: str, alias: str = "") -> Choice:
    title = f"{robot.robot} ({alias})" if alias else robot.robot
    return Choice(robot.name, title, kind, robot.maker, robot.licence)


def _uploaded(name: str, path: Path) -> Choice:
    text = path.read_bytes()[:1_000_000]
    arguments: dict[str, str] = {}
    for key, more in ARGUMENT.findall(text)[:MAX_ARGUMENTS]:
        default = DEFAULT.search(more)
        arguments[key.decode()] = default[1].decode("utf-8", "replace") if default else ""
    return Choice(name, path.name, "uploaded", arguments=arguments)


def routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes of the list, and of the upload."""
    hub = context.hub
    first = URDF_PATH if context.options is None else first_robot(context.options)
    uploads = TokenBucket(UPLOADS_PER_SECOND, BURST, hub.clock())

    async def robots(request: Request) -> Response:
        context.identity(request)
        return as_json(Choices(await asyncio.to_thread(choices, first)))

    async def upload(request: Request) -> Response:
        sender = context.driver(request, "upload files")
        if not uploads.take(hub.clock()):
            return as_json(answers.Refused(why="Too many files. Wait a moment."), TOO_MANY)
        name, main = (request.query_params.get(key, "")[:200] for key in ("name", "main"))
        hub.recorder.note("upload", actor_of(sender, CommandChannel.HTTP), {"name": name})
        data = await body_of(request, MAX_ARCHIVE_BYTES, UPLOAD_SECONDS, MIN_RATE)
        try:
            key = await asyncio.to_thread(keep_robot, data, name, main)
        except ChoiceError as error:
            refused = answers.Refused(why=str(error), choices=list(error.choices))
            return as_json(refused, NOT_UNDERSTOOD)
        return as_json(Kept(_uploaded(key, uploaded_robots()[key])))

    path = f"{ROOT}/robots"
    return [Route(path, robots), Route(path, upload, methods=["POST"])]
