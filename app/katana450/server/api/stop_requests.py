"""Requests about a stop, and the first on a connection. This module loads fast.

The process of STOP reads two of them. The gate makes the commands ``Stop`` and ``ClearStop`` of
these requests, with the cause and the time that it knows.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.arm.control.commands.act import Name, Request, Traits
from katana450.server.api.fields import Press


class Hello(Request, frozen=True, kw_only=True):
    """The first line on the TCP port: it identifies the program.

    Attributes:
        name: Name of the program that others see.
        token: Token of an access link, where the server requires one.
    """

    traits: ClassVar[Traits] = Traits()

    name: Name
    token: Annotated[str, Meta(max_length=400)] = ""


class Stop(Request, frozen=True, kw_only=True):
    """Stop the arm as fast as possible. Every client may do this at any time.

    Attributes:
        press: Name of this press of STOP. A client that repeats an unanswered stop sends the same
            name, and the stop counts once: a late repetition does not undo a ``clear_stop`` in
            between.
    """

    traits: ClassVar[Traits] = Traits(free=True, safety=True)

    press: Press = None


class ClearStop(Request, frozen=True):
    """Clear a stop: the arm accepts motion again. Nothing moves, and old targets are dropped."""

    traits: ClassVar[Traits] = Traits(free=True)
