"""The person or program that paused the arm last."""

from __future__ import annotations

import time
from typing import NamedTuple

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor
from katana450.arm.control.state import State


class LastPause(NamedTuple):
    """The last pause that was requested.

    Attributes:
        name: Display name of the person or program that requested it.
        key: Its key, see ``Person``.
        at: Time of the request [s] since 1970.
    """

    name: str
    key: str
    at: float

    @staticmethod
    def by(actor: Actor) -> LastPause:
        """Return the pause that ``actor`` requests now."""
        return LastPause(actor.name, actor.key, time.time())

    @staticmethod
    def after(
        before: LastPause | None, command: cmd.Command, actor: Actor, state: State
    ) -> LastPause | None:
        """Return the last pause after ``command`` of ``actor``, given in ``state``.

        A pause of an arm that is paused already keeps the first record.
        """
        for part in command.parts:
            if isinstance(part, cmd.Resume):
                before = None
            elif isinstance(part, cmd.Pause) and not (before is not None and state.paused):
                before = LastPause.by(actor)
        return before
