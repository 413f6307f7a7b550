"""One server for several test modules, each of which finds it as a new one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from katana450.client import Client, connect
from katana450.errors import KatanaError
from katana450.maths.kinematics.priority import Priority
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer


class SharedServer:
    """A server that is reset for each module, and started again if that does not make it as new.

    A start takes 2 s of processor time.
    """

    def __init__(self, command: Sequence[str] = APP) -> None:
        self._command = command
        self._server = AppServer(command)
        self._start: answers.State
        self._shown: dict[str, Any] = {}
        self._objects: set[str] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._server.stop()

    def as_new(self) -> AppServer:
        """Return the server with its arm in the ready posture, and the scene of a new server."""
        if not self._server.running or not self._reset():
            self._server.stop()
            self._server = AppServer(self._command)
            self._server.start()
            with connect(self._server.url, "Test") as client:
                self._start = client.query(answers.State)
                self._shown, self._objects = _shown(client), _objects(client)
        return self._server

    def _reset(self) -> bool:
        """Clear the stop, reset what requests can change; return whether nothing differs then."""
        try:
            with connect(self._server.url, "Test") as client:
                # From an open window, or a client that has just left.
                client.ask(requests.Take())
                client.clear_stop()
                client.ask(requests.Speed(value=1.0))
                if self._start.tool is not None:
                    client.ask(requests.Tool(name=self._start.tool))
                if self._start.priority is not None:
                    client.ask(requests.SetPriority(priority=Priority(self._start.priority)))
                for name in _objects(client) - self._objects:
                    client.ask(requests.Remove(name=name))
                client.go(requests.Gripper(angle=self._start.gripper))
                client.go(requests.Home())
                client.ask(requests.ReleaseLease())
                shown = _shown(client)
        except (KatanaError, OSError):
            return False
        return shown.keys() == self._shown.keys() and all(
            np.allclose(value, self._shown[name], rtol=0.0, atol=1e-6)
            if isinstance(value, list | float)
            else value == self._shown[name]
            for name, value in shown.items()
        )


def _objects(client: Client) -> set[str]:
    return {prop.name for prop in client.query(answers.Objects).objects}


def _shown(client: Client) -> dict[str, Any]:
    """Return what people and programs see: all nodes of the scene, water, tool and program."""
    state = client.query(answers.State)
    shown: dict[str, Any] = {
        "tool": state.tool,
        "priority": state.priority,
        "water": state.water,
        "program": state.program,
    }
    for node in client.query(answers.World).nodes:
        for field in node.fields:
            shown[f"{node.node}.{field.field}"] = field.value
    return shown
