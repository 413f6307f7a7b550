"""Base class of answers, and the types of the fields of requests and answers."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from katana450.arm.control.commands.act import Id, Traits, tag_of

VERSION = 1

ROOT = f"/api/v{VERSION}"
"""Path under which the API is served by HTTP."""

API = "/api/"
"""Prefix of the paths whose refusals are JSON."""

STOP_PATHS = ("/stop", f"{ROOT}/stop")
"""Paths of STOP, for pages and for programs. They are always answered."""

MAX_REQUEST_BYTES = 1024
"""Maximum size of a request [bytes]."""

MAX_STATES_PER_SECOND = 100
"""Maximum rate of states [1/s]: the rate of the control loop."""

Numbers = list[float]

MAX_PRESS_LENGTH = 64
"""Maximum length of the text that identifies one press of STOP."""

Press = Annotated[str, Meta(min_length=1, max_length=MAX_PRESS_LENGTH)] | None
FieldValue = Annotated[list[float], Meta(min_length=1, max_length=4)]
NodeName = Annotated[str, Meta(min_length=1, max_length=100)]
Key = Annotated[str, Meta(pattern="^[0-9a-f]{1,64}$")]


LEASE = Traits(free=True)
"""Traits of a request about the lease."""


class Answer(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="is", tag=tag_of
):
    """Base of all answers; ``is`` names the class, and ``id`` is that of the request."""

    id: Id = None
