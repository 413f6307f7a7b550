"""What comes and goes in the body of an HTTP message."""

from __future__ import annotations

import asyncio

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from katana450.server.api import answers

NOT_NOW, TOO_SLOW, TOO_LONG, NOT_UNDERSTOOD, TOO_MANY = 409, 408, 413, 422, 429
"""Status of an answer that refuses."""


BODY_SECONDS = 5.0
"""[s] In which a small body has come."""


async def body_of(request: Request, largest: int, seconds: float = BODY_SECONDS) -> bytes:
    """Return what is sent by POST.

    Raises HTTPException for more than ``largest`` bytes, and when it takes more than ``seconds``.
    """
    body = bytearray()
    try:
        async with asyncio.timeout(seconds):
            async for chunk in request.stream():
                body += chunk
                if len(body) > largest:
                    raise HTTPException(TOO_LONG, "That is too long.")
    except TimeoutError as error:
        why = f"The request did not come within {seconds:g} s."
        raise HTTPException(TOO_SLOW, why, {"Connection": "close"}) from error
    return bytes(body)


def as_json(answer: answers.Answer, status: int = 200) -> Response:
    """``answer``, to be sent."""
    return Response(answers.encoded(answer), status, media_type="application/json")
