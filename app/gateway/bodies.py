"""What comes and goes in the body of an HTTP message."""

from __future__ import annotations

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from app.api import answers

NOT_NOW, TOO_LONG, NOT_UNDERSTOOD = 409, 413, 422
"""Status of an answer that refuses."""


async def body_of(request: Request, largest: int) -> bytes:
    """What is sent by POST. Raises HTTPException for more than ``largest`` bytes."""
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > largest:
            raise HTTPException(TOO_LONG, "That is too long.")
    return bytes(body)


def as_json(answer: answers.Answer, status: int = 200) -> Response:
    """``answer``, to be sent."""
    return Response(answers.encoded(answer), status, media_type="application/json")
