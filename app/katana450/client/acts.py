"""The methods of the clients that make one request each, derived from the classes of these.

``acts.pyi`` beside this file has their signatures for editors and type checkers.
"""

from __future__ import annotations

import inspect
from inspect import Parameter
from typing import Any, Generic, TypeVar, get_args

import msgspec

from katana450.arm.control.commands.act import ENVELOPE, MotionRequest, Request, tag_of
from katana450.server.api import requests
from katana450.server.api.episode_requests import AnyEpisodeRequest

AtRest, Answered, Sent = TypeVar("AtRest"), TypeVar("Answered"), TypeVar("Sent")

OWN = (
    *(requests.Ask, requests.ClearStop, requests.ContinueFrom, requests.Heartbeat),
    *(requests.Hello, requests.Query, requests.Stop, requests.Watch),
)
"""Acts for which the clients have methods of their own, or whose name such a method has."""

METHODS = {tag_of(kind.__name__): kind for kind in requests.EVERY if kind not in OWN}
"""Class of the act of each method."""


def way_of(kind: type[Request]) -> str:
    """Return the method of a client that executes acts of ``kind``: ``go``, ``send`` or ``ask``."""
    if kind.traits.at_once:
        return "send"
    return "go" if issubclass(kind, MotionRequest) else "ask"


def signature_of(kind: type[msgspec.Struct]) -> inspect.Signature:
    """Return the signature of the method that makes a request of ``kind``: its own fields."""
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    parameters = [Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)]
    for name, field in fields.items():
        if name in ENVELOPE:
            continue
        default = Parameter.empty if field.required else field.default
        parameters.append(Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=default))
    return inspect.Signature(parameters)


def documentation_of(kind: type[msgspec.Struct]) -> str:
    """Return the docstring of the method that makes a request of ``kind``."""
    return (inspect.getdoc(kind) or "").replace("Attributes:", "Args:")


def add_method(owner: type, name: str, kind: type[msgspec.Struct], way: str) -> None:
    """Add to ``owner`` the method that passes a request of ``kind`` to its method ``way``."""
    signature = signature_of(kind)

    def method(*args: Any, **fields: Any) -> Any:
        client, *_ = args
        values = dict(signature.bind(*args, **fields).arguments)
        del values["self"]
        return getattr(client, way)(kind(**values))

    method.__name__, method.__qualname__ = name, f"{owner.__name__}.{name}"
    method.__doc__ = documentation_of(kind)
    vars(method)["__signature__"] = signature
    setattr(owner, name, method)


class Acts(Generic[AtRest, Answered, Sent]):
    """One method for each act. Those of ``AsyncClient`` are awaited.

    A motion is waited for, as by ``go``; a sample of a stream is sent, as by ``send``; any other
    act is answered, as by ``ask``.
    """


for name, kind in METHODS.items():
    add_method(Acts, name, kind, way_of(kind))


EPISODE_METHODS = {kind.__struct_config__.tag: kind for kind in get_args(AnyEpisodeRequest)}
"""Class of the request of each method about episodes."""


class EpisodeActs:
    """One method for each request about episodes; it returns the number of the episode."""


for name, kind in EPISODE_METHODS.items():
    add_method(EpisodeActs, name, kind, "ask")
