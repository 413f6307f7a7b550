"""The request ``undo``."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from typing import Any

from katana450.extensions.undo.history import UndoHistory
from katana450.server.api import answers, requests
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.request_handler import RequestHandler


class UndoRequests(RequestHandler):
    """Undoes the last change of a participant."""

    request_types = (requests.Undo,)

    def __init__(self, hub: Hub, options: Namespace) -> None:
        super().__init__(hub, options)
        self.history = UndoHistory(hub.clock)
        hub.gate.delivered.append(self.history.note)

    def handle(self, participant: Participant, request: requests.Request) -> answers.Done:
        """Undo the last change of ``participant``. Raises as ``CommandGate.submit`` does."""
        gate, actor = self.hub.gate, replace(participant.actor, seen=request.revocations)
        with gate.lock:
            arm, revocations = gate.check_runs(), gate.revocations
            gate.check_current(actor)
            change, command = self.history.inverse(actor.key, revocations, arm.state)
            ticket = gate.submit(command, actor)
            self.history.forget(change, arm.outcome(ticket))
        return answers.Done(ticket=ticket, revocations=revocations)

    def page_status(self, participant: Participant) -> dict[str, Any]:
        """Return the names of the changes that ``participant`` can undo, the newest first."""
        changes = self.history.changes(participant.person.key, self.hub.gate.revocations)
        return {"undo": [each.name for each in changes]}
