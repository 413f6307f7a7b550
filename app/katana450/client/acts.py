"""The methods of the clients that make one act each, derived from the classes of the acts.

``acts.pyi`` beside this file has their signatures for editors and type checkers.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from inspect import Parameter
from typing import Any, Generic, TypeVar

import msgspec

from katana450.arm.control.commands.act import MotionRequest, Request, content_names, tag_of
from katana450.server.api import requests

AtRest, Answered, Sent = TypeVar("AtRest"), TypeVar("Answered"), TypeVar("Sent")

OWN = (
    *(requests.Ask, requests.ClearStop, requests.Go, requests.Heartbeat, requests.Hello),
    *(requests.Query, requests.Stop, requests.Watch),
)
"""Acts for which the clients have methods of their own, or whose name such a method has."""

METHODS = {tag_of(kind.__name__): kind for kind in requests.EVERY if kind not in OWN}
"""Class of the act of each method."""


def way_of(kind: type[Request]) -> str:
    """Return the method of a client that executes acts of ``kind``: ``go``, ``send`` or ``ask``."""
    if kind.traits.at_once:
        return "send"
    return "go" if issubclass(kind, MotionRequest) else "ask"


def signature_of(kind: type[Request]) -> inspect.Signature:
    """Return the signature of the method that makes an act of ``kind``: its own fields."""
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    parameters = [Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)]
    for name in content_names(kind):
        default = Parameter.empty if fields[name].required else fields[name].default
        parameters.append(Parameter(name, Parameter.POSITIONAL_OR_KEYWORD, default=default))
    return inspect.Signature(parameters)


def documentation_of(kind: type[Request]) -> str:
    """Return the docstring of the method that makes an act of ``kind``."""
    return (inspect.getdoc(kind) or "").replace("Attributes:", "Args:")


def _method(name: str, kind: type[Request]) -> Callable[..., Any]:
    signature, way = signature_of(kind), way_of(kind)

    def method(*args: Any, **fields: Any) -> Any:
        client, *_ = args
        values = dict(signature.bind(*args, **fields).arguments)
        del values["self"]
        return getattr(client, way)(kind(**values))

    method.__name__, method.__qualname__ = name, f"Acts.{name}"
    method.__doc__ = documentation_of(kind)
    vars(method)["__signature__"] = signature
    return method


class Acts(Generic[AtRest, Answered, Sent]):
    """One method for each act. Those of ``AsyncClient`` are awaited.

    A motion is waited for, as by ``go``; a sample of a stream is sent, as by ``send``; any other
    act is answered, as by ``ask``.
    """


for name, kind in METHODS.items():
    setattr(Acts, name, _method(name, kind))
