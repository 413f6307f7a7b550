"""The services of rosapi with which clients look up topics, services, actions and the robot."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from katana450.errors import InputError
from katana450.extensions.rosbridge.messages import time_of
from katana450.extensions.rosbridge.names import ACTIONS, SERVICES, TOPICS, is_type
from katana450.extensions.rosbridge.ops import read

ROSAPI = "/rosapi/"

NODE = "/katana450"
"""Name of the only node."""


class Arguments(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The arguments of all services here; each uses one of them, or none."""

    topic: str = ""
    service: str = ""
    type: str = ""
    name: str = ""
    default: str = ""
    default_value: str = ""


def call(service: str, raw: msgspec.Raw, description: Callable[[], str]) -> dict[str, Any]:
    """Return the values of the answer of ``service``.

    ``description`` returns the robot's description. Raises InputError for invalid arguments.
    """
    arguments = read(raw, Arguments, f"a call of {service}")
    match service.removeprefix(ROSAPI):
        case "topics":
            return {"topics": list(TOPICS), "types": list(TOPICS.values())}
        case "topics_for_type":
            return {"topics": _of_type(TOPICS, arguments.type)}
        case "topic_type":
            return {"type": TOPICS.get(arguments.topic, "")}
        case "services":
            return {"services": list(SERVICES)}
        case "services_for_type":
            return {"services": _of_type(SERVICES, arguments.type)}
        case "service_type":
            return {"type": SERVICES.get(arguments.service, "")}
        case "action_servers":
            return {"action_servers": list(ACTIONS)}
        case "nodes":
            return {"nodes": [NODE]}
        case "get_time":
            return {"time": time_of(time.time())}
        case "get_param":
            return {"value": _parameter(arguments, description)}
    raise AssertionError(f"{service} is listed but not implemented.")


def _of_type(known: Mapping[str, str], kind: str) -> list[str]:
    return [name for name, known_kind in known.items() if is_type(kind, known_kind)]


def _parameter(arguments: Arguments, description: Callable[[], str]) -> str:
    """Return the value of the parameter as JSON text. Raises InputError if it is unknown."""
    if arguments.name.rpartition(":")[2].lstrip("/") == "robot_description":
        return json.dumps(description())
    default = arguments.default or arguments.default_value
    if default:
        return default
    raise InputError(f"There is no parameter {arguments.name[:80]!r}, only robot_description.")
