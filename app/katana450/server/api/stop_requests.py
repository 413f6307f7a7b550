"""The two requests that the process of STOP reads; this module loads fast."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from katana450.server.api.fields import COMMAND, Name, Press, Request, RequestTraits


class Hello(Request, frozen=True, kw_only=True):
    """The first line on the TCP port: it identifies the program.

    Attributes:
        name: Name of the program that others see.
        token: Token of an access link, where the server requires one.
    """

    traits: ClassVar[RequestTraits] = COMMAND

    name: Name
    token: Annotated[str, Meta(max_length=400)] = ""


class Stop(Request, frozen=True, kw_only=True):
    """Stop the arm as fast as possible. Every client may do this at any time.

    Attributes:
        press: Name of this press of STOP. A client that repeats an unanswered stop sends the same
            name, and the stop counts once: a late repetition does not undo a ``clear_stop`` in
            between.
    """

    traits: ClassVar[RequestTraits] = RequestTraits(free=True, safety=True)

    press: Press = None
