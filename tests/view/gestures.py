"""A gesture gate that admits and records every command."""

from __future__ import annotations

from katana450.arm.control.commands.commands import Command
from katana450.arm.control.lease import Actor, CommandChannel, Person, Role

ANNA = Actor(Person("anna", "Anna", Role.OPERATOR), CommandChannel.SCENE, seen=0)


class RecordedGestures:
    """A gate whose actor is always Anna."""

    def __init__(self) -> None:
        self.commands: list[Command] = []
        self.revocations = 0

    def actor(self, _client_id: int | None) -> Actor:
        return ANNA

    def submit(self, command: Command, _actor: Actor) -> int:
        self.commands.append(command)
        return len(self.commands)

    def is_current(self, actor: Actor) -> bool:
        return actor.seen == self.revocations
