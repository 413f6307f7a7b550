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
    """Undoes the last change of a participant, and repeats one that was undone."""

    request_types = (requests.Undo, requests.Redo)

    def __init__(self, hub: Hub, options: Namespace) -> None:
        super().__init__(hub, options)
        self.history = UndoHistory(hub.clock)
        hub.gate.delivered.append(self.history.note)

    def handle(self, participant: Participant, request: requests.Request) -> answers.Done:
        """Undo or redo a change of ``participant``. Raises as ``CommandGate.submit`` does."""
        redo, history = isinstance(request, requests.Redo), self.history
        gate, actor = self.hub.gate, replace(participant.actor, seen=request.revocations)
        with gate.lock:
            arm, revocations = gate.check_runs(), gate.revocations
            gate.check_current(actor)
            before = history.stacks
            change, command = history.inverse(actor.key, revocations, arm.state, redo=redo)
            back = history.back(change, command, arm.state) if arm.caught_up else None
            ticket = gate.submit(command, actor)
            history.move(change, back, before, arm.outcome(ticket), redo=redo)
        return answers.Done(ticket=ticket, revocations=revocations)

    def page_status(self, participant: Participant) -> dict[str, Any]:
        """Return the names of what ``participant`` can undo and redo, the newest first."""
        of = participant.person.key, self.hub.gate.revocations
        changes, undone = self.history.changes(*of), self.history.changes(*of, redo=True)
        return {"undo": [each.name for each in changes], "redo": [each.name for each in undone]}
