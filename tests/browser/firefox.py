"""Firefox with its own remote protocol, WebDriver BiDi: mouse, keys and scripts of one window.

Playwright drives only a Firefox of its own, which no system has. See
https://w3c.github.io/webdriver-bidi/ for the commands.
"""

from __future__ import annotations

import base64
import json
import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Self

from websockets.sync.client import connect
from websockets.sync.connection import Connection

from tests.exchange.tools import SCREEN, needs

PROGRAMS = ("firefox-esr", "xvfb-run", "xauth")
"""Programs that a run needs. Without a screen Firefox has no WebGL."""

needs_firefox = needs(*PROGRAMS)

PREFERENCES = {
    "webgl.force-enabled": True,
    # Requests of the browser itself.
    "app.normandy.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
}

START_SECONDS = 60.0
ANSWER_SECONDS = 60.0
WINDOW = {"width": 1280, "height": 800}
MOVE_MILLISECONDS = 30
"""[ms] Duration of one move of the mouse."""


class Firefox:
    """One Firefox window, to be used in a ``with`` block.

    Pixels are relative to the window's top left corner.
    """

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._socket: Connection
        self._number = 0
        self._window = ""
        self.errors: list[str] = []
        """Errors of scripts and on the console, up to the last command."""

    def __enter__(self) -> Self:
        profile = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
        lines = (f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items())
        (profile / "user.js").write_text("\n".join(lines), encoding="utf-8")
        words = (*SCREEN, "firefox-esr", "--no-remote", "--profile", str(profile))
        process = subprocess.Popen(
            [*words, "--remote-debugging-port", "0", "about:blank"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self._stack.callback(_end, process)
        try:
            self._socket = self._stack.enter_context(connect(_address(process), max_size=None))
            self.ask("session.new", capabilities={})
            self.ask("session.subscribe", events=["log.entryAdded"])
            self._window = self.ask("browsingContext.getTree")["contexts"][0]["context"]
            self.ask("browsingContext.setViewport", context=self._window, viewport=WINDOW)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Execute a command of the protocol; return its result. Raises AssertionError."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(ANSWER_SECONDS))
            if message.get("method") == "log.entryAdded" and message["params"]["level"] == "error":
                self.errors.append(str(message["params"]["text"]))
            if message.get("id") == self._number:
                assert message["type"] == "success", f"{method}: {message}"
                result: dict[str, Any] = message["result"]
                return result

    def open(self, url: str) -> None:
        """Load a page."""
        self.ask("browsingContext.navigate", context=self._window, url=url, wait="complete")

    def evaluate(self, script: str, *, in_frame: bool = False) -> Any:
        """Return the JSON value of an expression, in the page or in its frame."""
        window = self._window
        if in_frame:
            tree = self.ask("browsingContext.getTree", root=window)
            window = tree["contexts"][0]["children"][0]["context"]
        answer = self.ask(
            "script.evaluate",
            expression=f"(async () => JSON.stringify(await ({script})) ?? 'null')()",
            target={"context": window},
            awaitPromise=True,
        )
        assert answer["type"] == "success", f"{script}: {answer['exceptionDetails']['text']}"
        return json.loads(answer["result"]["value"])

    def wait_until(self, script: str, *, seconds: float = 60.0, in_frame: bool = False) -> None:
        """Return once an expression is true. Raises AssertionError after a time [s]."""
        end = time.monotonic() + seconds
        while not self.evaluate(f"Boolean({script})", in_frame=in_frame):
            assert time.monotonic() < end, f"not within {seconds:g} s: {script}"
            time.sleep(0.1)

    def drag(self, way: Sequence[tuple[float, float]]) -> None:
        """Press the mouse at the first pixel of ``way``, move along it, and release."""
        moves = [
            {"type": "pointerMove", "x": round(x), "y": round(y), "duration": MOVE_MILLISECONDS}
            for x, y in way
        ]
        down, up = ({"type": f"pointer{end}", "button": 0} for end in ("Down", "Up"))
        self._perform("pointer", [moves[0], down, *moves[1:], up])

    def click(self, selector: str) -> None:
        """Click the middle of an element of the page."""
        box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
        self.drag(
            [
                self.evaluate(
                    f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])({box})"
                )
            ]
        )

    def press(self, key: str, seconds: float = 0.0) -> None:
        """Press a key, and release it after a time [s]."""
        down, up = ({"type": f"key{end}", "value": key} for end in ("Down", "Up"))
        self._perform("key", [down, {"type": "pause", "duration": round(1000 * seconds)}, up])

    def _perform(self, kind: str, actions: list[dict[str, Any]]) -> None:
        source = {"type": kind, "id": kind, "actions": actions}
        self.ask("input.performActions", context=self._window, actions=[source])

    def screenshot(self, path: Path) -> None:
        """Write a picture of the window."""
        png = self.ask("browsingContext.captureScreenshot", context=self._window)["data"]
        path.write_bytes(base64.b64decode(png))


def _address(process: subprocess.Popen[str]) -> str:
    """Return the address at which the browser takes commands."""
    assert process.stderr is not None
    end = time.monotonic() + START_SECONDS
    for line in process.stderr:
        match = re.search(r"WebDriver BiDi listening on (\S+)", line)
        if match:
            return f"{match[1]}/session"
        assert time.monotonic() < end, "Firefox did not start"
    raise AssertionError(f"Firefox ended with status {process.wait()}")


def _end(process: subprocess.Popen[str]) -> None:
    # With its children and the screen.
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    if process.stderr is not None:
        process.stderr.close()
