"""Bodies of HTTP requests and responses."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from typing import Any

import msgspec
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from katana450.errors import CancelledError, LeaseError
from katana450.server.api import answers
from katana450.server.api.fields import API
from katana450.server.service.limits import CrowdedError

NOT_NOW, TOO_SLOW, TOO_LONG, NOT_UNDERSTOOD, TOO_MANY = 409, 408, 413, 422, 429
"""HTTP status codes of refusals."""

BODY_SECONDS = 5.0
"""Timeout for receiving a small body [s]."""


async def body_of(
    request: Request, largest: int, seconds: float = BODY_SECONDS, rate: float = math.inf
) -> bytes:
    """Return the body of ``request``.

    Raises HTTPException for more than ``largest`` bytes, and after ``seconds``, or after
    ``BODY_SECONDS`` if less than ``rate`` [bytes/s] arrives in the mean of the time beyond.
    """
    body, began = bytearray(), asyncio.get_running_loop().time()
    slow = min(began + BODY_SECONDS, began + seconds)
    try:
        async with asyncio.timeout_at(slow) as limit:
            async for chunk in request.stream():
                body += chunk
                if len(body) > largest:
                    raise HTTPException(TOO_LONG, f"The body is larger than {largest} bytes.")
                limit.reschedule(min(slow + len(body) / rate, began + seconds))
    except TimeoutError as error:
        why = f"The request was not received within {seconds:g} s."
        if rate < math.inf:
            why = f"A file must be received within {seconds:g} s, and at {rate:g} bytes/s at least."
        raise HTTPException(TOO_SLOW, why, {"Connection": "close"}) from error
    return bytes(body)


def as_json(answer: Any, status: int = 200, headers: Mapping[str, str] | None = None) -> Response:
    """Return ``answer``, one of the API or other values of JSON, as an HTTP response."""
    if isinstance(answer, answers.Refused):
        answer = answer.with_status(status)
    return Response(msgspec.json.encode(answer), status, headers, media_type="application/json")


def status_of(error: Exception) -> int:
    """Return the HTTP status of a refusal by ``error``, a KatanaError."""
    if isinstance(error, CrowdedError):
        return TOO_MANY
    return NOT_NOW if isinstance(error, LeaseError | CancelledError) else NOT_UNDERSTOOD


def refusal(path: str, why: str, status: int, headers: Mapping[str, str] | None = None) -> Response:
    """Return the refusal of a request for ``path``: of the API as JSON, else as text."""
    if path.startswith(API):
        return as_json(answers.Refused(why=why), status, headers)
    return PlainTextResponse(why, status, headers)
