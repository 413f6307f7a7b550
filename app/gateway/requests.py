"""What a page may say on its control socket: small JSON objects of exactly these shapes."""

from __future__ import annotations

import math

import msgspec

from app.errors import InputError
from app.gateway.motion import Rates
from app.kinematics.velocity import JogFrame

LARGEST = 512
"""Bytes of a request."""

FASTEST_LINEAR = 0.5
"""[m/s] More than the arm can do; anything beyond is no page's wish."""

FASTEST_ANGULAR = 3.0
"""[rad/s] Likewise."""

SLOWEST, FASTEST = 0.05, 1.0
"""Share of full speed."""


class Request(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do", tag=str.lower
):
    """Any of them; ``do`` is the name of the class."""


class Beat(Request, frozen=True):
    """A sign of life; the number comes back, which gives the round trip."""

    n: int


class Stop(Request, frozen=True):
    """Stop the arm."""


class Reset(Request, frozen=True):
    """End a stop."""


class Acquire(Request, frozen=True):
    """Have the arm if nobody has it."""


class Take(Request, frozen=True):
    """Have it even so."""


class Ask(Request, frozen=True):
    """Ask whoever has it."""


class Withdraw(Request, frozen=True):
    """Ask no more."""


class Release(Request, frozen=True):
    """Give it up."""


class Give(Request, frozen=True):
    """Give it to the window of that number."""

    to: int


class Jog(Request, frozen=True):
    """Move for a moment: (x, y, z) [m/s], pitch and roll [rad/s], along the axes of a frame."""

    rates: Rates
    frame: JogFrame

    def __post_init__(self) -> None:
        limits = (FASTEST_LINEAR,) * 3 + (FASTEST_ANGULAR,) * 2
        for rate, limit in zip(self.rates, limits, strict=True):
            if not math.isfinite(rate) or abs(rate) > limit:
                raise ValueError(f"{rate} is no rate between {-limit:g} and {limit:g}")


class Speed(Request, frozen=True):
    """How fast jogging is, as a share of full speed."""

    value: float

    def __post_init__(self) -> None:
        if not SLOWEST <= self.value <= FASTEST:
            raise ValueError(f"a speed is between {SLOWEST:g} and {FASTEST:g}")


AnyRequest = Beat | Stop | Reset | Acquire | Take | Ask | Withdraw | Release | Give | Jog | Speed

_decoder: msgspec.json.Decoder[AnyRequest] = msgspec.json.Decoder(AnyRequest)


def decoded(text: str) -> AnyRequest:
    """The request that ``text`` is. Raises InputError for one that it is not."""
    if len(text) > LARGEST:
        raise InputError(f"A request has at most {LARGEST} bytes.")
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise InputError(f"That is no request: {error}.") from error
