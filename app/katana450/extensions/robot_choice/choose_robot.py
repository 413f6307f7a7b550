"""The request that lets the server drive another robot, and where the list of robots is."""

from __future__ import annotations

import hashlib
import logging
import threading
from argparse import Namespace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from msgspec import Meta
from starlette.routing import BaseRoute

from katana450.arm.control.commands.act import Request, Traits
from katana450.errors import InputError, KatanaError, LeaseError
from katana450.extensions.late_routes import LateRoutes
from katana450.extensions.robot_choice.robot_check import FIRST, checked_robot, first_robot
from katana450.server.api import answers
from katana450.server.api.fields import ROOT
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.runner import RequestHandler
from katana450.server.web.http_api import RouteContext

Text = Annotated[str, Meta(max_length=200)]

log = logging.getLogger(__name__)


class ChooseRobot(Request, frozen=True):
    """Let the server drive another robot.

    Refused while the arm moves or is stopped, while a program runs, if another person drives, and
    for a server with a real arm. The server reads the robot first, and keeps the present one if
    that fails: the status of the page says why. Then its processes are started again with that
    robot, so that every client connects again. Objects, the undo list and plans are gone; the
    recordings and the event log stay.

    Attributes:
        robot: Its name in the list at ``/api/v1/robots``.
        arguments: Values of arguments of a xacro file, by their names.
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    robot: Annotated[str, Meta(min_length=1, max_length=80)]
    arguments: dict[Text, Text] | None = None


def late_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the routes that list robots and upload one, imported with the first request."""

    def make() -> list[BaseRoute]:
        from katana450.extensions.robot_choice.robot_routes import routes

        return routes(context)

    return LateRoutes([f"{ROOT}/robots"], make).routes()


class RobotChoice(RequestHandler):
    """Reads a chosen robot in a thread, and then lets the supervisor start it."""

    request_types = (ChooseRobot,)

    def __init__(self, hub: Hub, options: Namespace) -> None:
        self.hub, self._options = hub, options
        self._loading: str | None = None
        self._problem: str = getattr(options, "robot_problem", None) or ""
        urdf = Path(options.urdf)
        self._robot = {
            "name": urdf.stem,
            "key": hashlib.sha256(str(urdf).encode()).hexdigest()[:12],
        }

    def handle(self, participant: Participant, request: Request) -> answers.Done:
        """Begin to read the robot of ``request``. Raises LeaseError and InputError."""
        assert isinstance(request, ChooseRobot)
        with self.hub.gate.lock:
            self._check(participant)
            if self._loading is not None:
                raise InputError(f"{self._loading} is being read. Wait until that ends.")
            self._loading, self._problem = request.robot, ""
        threading.Thread(
            target=self._read, args=(participant, request), name="robot choice", daemon=True
        ).start()
        return answers.Done()

    def page_status(self, participant: Participant) -> dict[str, Any]:  # noqa: ARG002
        """Return the present robot, the one that is read, and why the last choice failed."""
        return {"robot": {**self._robot, "loading": self._loading, "problem": self._problem}}

    def _check(self, participant: Participant) -> None:
        """Raise LeaseError or InputError if ``participant`` may not change the robot now."""
        if self.hub.replace_robot is None or getattr(self._options, "device", None):
            raise InputError("This server drives a real arm, so its robot cannot be changed.")
        if self.hub.runner.running:
            raise LeaseError("A program runs. Wait until it ends.")
        self.hub.gate.claim(participant.actor)
        if self.hub.present().state.moving:
            raise LeaseError("The arm moves. Wait until it is at rest.")

    def _read(self, participant: Participant, request: ChooseRobot) -> None:
        name, gate, replace_robot = request.robot, self.hub.gate, self.hub.replace_robot
        assert replace_robot is not None
        try:
            urdf = checked_robot(self._file(name), request.arguments or {})
            with gate.lock:
                self._check(participant)
            log.warning("%s chose the robot %s.", participant.person.name, name)
            self.hub.recorder.note("robot", participant.actor, {"name": name})
            # Without the lock, for which a STOP would wait.
            replace_robot(urdf)
        except KatanaError as error:
            self._loading, self._problem = None, str(error)
        except Exception:
            self._loading, self._problem = None, "It could not be read: the log says why."
            raise

    def _file(self, name: str) -> Path:
        """Return the description of the robot ``name``. Raises KatanaError."""
        if name == FIRST:
            return first_robot(self._options)
        from katana450.extensions.robot_choice.uploaded_robots import used_robot

        path = used_robot(name)
        if path is not None:
            return path
        from katana450.extensions.gallery.arms_command import file_of, robot_named

        return file_of(robot_named(name))
