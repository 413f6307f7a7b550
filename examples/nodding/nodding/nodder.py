"""The request ``nod``, which turns the fourth joint."""

from __future__ import annotations

from argparse import Namespace
from typing import ClassVar

from katana450.sdk import (
    Command,
    Hub,
    MotionRequest,
    Participant,
    Request,
    RequestHandler,
    Traits,
    commands,
)

JOINT = 4
"""The joint that turns, counted from 1."""


class Nod(MotionRequest, frozen=True, kw_only=True):
    """Turn the fourth joint by a relative angle.

    Attributes:
        by: Angle [rad].
    """

    traits: ClassVar[Traits] = Traits(extension=True)

    by: float


class Nodder(RequestHandler):
    """Answers ``nod`` by the command ``nudge``, under the rights and limits of the server."""

    request_types = (Nod,)

    def __init__(self, hub: Hub, _options: Namespace) -> None:
        self._hub = hub

    def handle(self, _participant: Participant, request: Request) -> Command:
        """Return the command of ``request``, which the server then submits."""
        assert isinstance(request, Nod)
        return commands.Nudge(JOINT, request.by)
