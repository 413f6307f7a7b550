"""Requests of admins about everybody who is connected."""

from __future__ import annotations

import logging
import math
from argparse import Namespace

from katana450.arm.control.lease import Role
from katana450.errors import InputError, LeaseError
from katana450.server.api import answers, requests
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant, session_of
from katana450.server.service.people import Connection
from katana450.server.service.runner import RequestHandler

log = logging.getLogger(__name__)


class PeopleRequests(RequestHandler):
    """Executes the requests of admins about people.

    The dispatcher has checked that the sender is one. Raises LeaseError for what even an admin may
    not do, and InputError for an unknown person.
    """

    request_types = (requests.ListPeople, requests.Kick)

    def __init__(self, hub: Hub, _options: Namespace) -> None:
        self.hub = hub
        self._people = hub.people

    def handle(self, participant: Participant, request: requests.Request) -> answers.Answer:
        """Execute ``request`` and return its answer."""
        match request:
            case requests.ListPeople():
                return answers.People(people=self._list(session_of(participant.person.key)))
            case requests.Kick(person=number):
                self._kick(participant, self._person(number), request)
        return answers.Done()

    def _kick(self, participant: Participant, person: Identity, request: requests.Kick) -> None:
        by, name, people = participant.person.name, self._name(person), self._people
        links = people.links
        if person.session == session_of(participant.person.key):
            raise InputError("You cannot disconnect yourself. Close your windows instead.")
        if not request.revoke:
            self._note("kick", participant, person, seconds=request.seconds)
            if request.seconds:
                log.warning("%s disconnected %s for %g s.", by, name, request.seconds)
                self._remove(person, request.seconds)
            else:
                log.warning("%s let %s in again.", by, name)
                people.let_in(person.session)
            return
        if links is None:
            raise InputError("This server has no links that could be revoked.")
        if person.role is Role.ADMIN:
            raise LeaseError("Revoke the link of an admin with `katana450 access revoke`.")
        self._note("revoke", participant, person)
        self._remove(person, math.inf)
        log.warning("%s revoked the link of %s.", by, name)
        people.write(
            lambda: links.revoke(person.session),
            lambda why: _report(
                participant, f"The link of {name} works again after a restart. {why}"
            ),
        )

    def _remove(self, person: Identity, seconds: float) -> None:
        """Disconnect ``person`` for ``seconds``, and end what runs on its behalf."""
        self._people.kick(person, seconds)
        self.hub.runner.removed(person.session)

    def _note(self, kind: str, participant: Participant, person: Identity, **values: float) -> None:
        """Note for the event log what an admin did to ``person``."""
        what = {"person": self._name(person), "link": person.link, **values}
        self.hub.recorder.note(kind, participant.actor, what, always=True)

    def _person(self, number: int) -> Identity:
        identity = self._people.identity(number)
        if identity is None:
            raise InputError(f"No person has the number {number} now. List the people again.")
        return identity

    def _list(self, asker: str) -> tuple[answers.ConnectedPerson, ...]:
        connections, shown = self._people.connections, self._people.shown
        return tuple(
            self._described(number, shown[number], connections, you=shown[number].session == asker)
            for number in sorted(shown)
        )

    def _described(
        self,
        number: int,
        identity: Identity,
        connections: dict[str, list[Connection]],
        *,
        you: bool,
    ) -> answers.ConnectedPerson:
        people, session = self._people, identity.session
        kept_out = people.kept_out(session)
        return answers.ConnectedPerson(
            person=number,
            name=self._name(identity),
            role=identity.role.value,
            link=None if people.links is None else session,
            you=you,
            drives=session in self.hub.drivers,
            kept_out=round(kept_out, 1) if kept_out else None,
            addresses=tuple(connection.address for connection in connections.get(session, ())),
        )

    def _name(self, identity: Identity) -> str:
        """Return the name of the link; without links, of the first participant."""
        if identity.link_name:
            return identity.link_name
        for connection in self._people.connections.get(identity.session, ()):
            participant = self.hub.participant(connection.key)
            if participant is not None:
                return participant.person.name
        return identity.name or "Somebody"


def _report(participant: Participant, why: str) -> None:
    """Send ``participant`` the reason ``why`` of a refusal."""
    participant.notify({"is": "refused", "why": why})
