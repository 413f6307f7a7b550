"""The request that lets the simulated arm continue from a recorded moment."""

from __future__ import annotations

import asyncio
from argparse import Namespace
from collections.abc import Awaitable

from msgspec.structs import replace

from katana450.arm.control.commands.act import Request
from katana450.arm.control.commands.commands import RestoreState
from katana450.errors import LeaseError
from katana450.extension import load
from katana450.extensions.programs.server.program_participant import check_may_drive
from katana450.server.api import answers
from katana450.server.api.requests import ContinueFrom
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.runner import RequestHandler

STORE = "katana450.extensions.recording.playback.store:store_of"


class Continuation(RequestHandler):
    """Lets the arm continue from the state at a recorded moment, which is simulated in a thread."""

    request_types = (ContinueFrom,)

    def __init__(self, hub: Hub, options: Namespace) -> None:
        self._hub, self._options = hub, options

    def handle(self, participant: Participant, request: Request) -> Awaitable[answers.Done]:
        """Return the answer to ``request``, once it is there. Raises LeaseError for a viewer."""
        assert isinstance(request, ContinueFrom)
        check_may_drive(participant.person)
        if request.revocations is None:
            # A stop during the simulation is newer than the request.
            request = replace(request, revocations=self._hub.gate.revocations)
        return self._continued(participant, request)

    async def _continued(self, participant: Participant, request: ContinueFrom) -> answers.Done:
        hub = self._hub
        session = hub.present().session
        # Loaded with the first request, so that the start takes no longer.
        store = await asyncio.to_thread(lambda: load(STORE)(hub, self._options))
        state = await store.state_at(request.of, request.t, session)
        if hub.participant(participant.person.key) is not participant:
            raise LeaseError("That window or program is no longer connected.")
        command = RestoreState(state, request.of)
        ticket = hub.move(participant, command, seen=request.revocations)
        return answers.Done(ticket=ticket, revocations=hub.gate.revocations)
