"""One server for several test modules, each of which finds it as a new one."""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np

from katana450.client import Client, RefusedError, connect
from katana450.errors import KatanaError
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer

LEASE_SECONDS = 4.0
"""[s] Time in which a window or program that has left loses the lease."""


class SharedServer:
    """A server that is started again only if a module left more than a moved arm.

    A start takes 2 s of processor time.
    """

    def __init__(self, command: Sequence[str] = APP) -> None:
        self._command = command
        self._server = AppServer(command)
        self._new: dict[str, Any] = {}
        self._gripper = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.stop()

    def as_new(self) -> AppServer:
        """Return the server with its arm in the ready posture, and the scene of a new server."""
        if not self._server.running or not self._renewed():
            self._server.stop()
            self._server = AppServer(self._command)
            self._server.start()
            with connect(self._server.url, "Test") as client:
                self._new = _shown(client)
                self._gripper = client.query(answers.State).gripper
        return self._server

    def _renewed(self) -> bool:
        """Drive the arm home; return whether nothing differs from a new server."""
        try:
            with connect(self._server.url, "Test") as client:
                _acquire(client)
                client.clear_stop()
                client.ask(requests.Speed(value=1.0))
                client.go(requests.Gripper(angle=self._gripper))
                client.go(requests.Home())
                client.ask(requests.ReleaseLease())
                shown = _shown(client)
        except (KatanaError, OSError):
            return False
        return shown.keys() == self._new.keys() and all(
            np.allclose(value, self._new[name], rtol=0.0, atol=1e-6)
            if isinstance(value, list | float)
            else value == self._new[name]
            for name, value in shown.items()
        )


def _acquire(client: Client) -> None:
    """Acquire the lease, which a client that has left may still hold."""
    end = time.monotonic() + LEASE_SECONDS
    while True:
        try:
            client.ask(requests.Acquire())
        except RefusedError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)
        else:
            return


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
