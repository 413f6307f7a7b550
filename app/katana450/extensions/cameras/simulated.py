"""Cameras of the simulation: the newest state of the arm, rendered as often as there is time."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection

from PIL import Image

from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import State
from katana450.arm.runtime.pipes.guarded_pipe import PIPE_ERRORS
from katana450.arm.runtime.pipes.private_listener import Greeting, PrivateAddress, connect
from katana450.errors import LeaseError
from katana450.extension import ServerFacts, load
from katana450.extensions.cameras.sources import QUALITY, CameraFrame

VIEWS = {"wrist": "wrist", "overview": "free"}
"""Views of the pictures by their names in an address."""

SIZE = 320, 240
"""[px] Width and height of a picture."""

STATES = "states"
"""Role of the page's server when it sends states."""

PERIOD = 0.1
"""[s] Time between two states."""

STUDIO = "katana450.extensions.media.stage:Studio"


class StateReceiver:
    """The newest state of the arm, from the page's server."""

    def __init__(self, facts: ServerFacts) -> None:
        self._facts = facts
        self._changed = threading.Condition()
        self._newest: tuple[float, State] | None = None

    def take(self, connection: Connection, _greeting: Greeting) -> None:
        """Take states until ``connection`` closes; None stands for the same state again."""
        with suppress(*PIPE_ERRORS):
            while True:
                state, t = connection.recv(), time.perf_counter()
                with self._changed:
                    last = None if self._newest is None else self._newest[1]
                    state = last if state is None else state
                    self._newest = None if state is None else (t, state)
                    self._changed.notify_all()

    def frames(self, view: str) -> Iterator[CameraFrame]:
        """Yield a picture of each state that comes while none is rendered.

        Raises InputError for a robot without this view, and MissingExtraError.
        """
        facts = self._facts
        studio = load(STUDIO).of(((VIEWS[view], SIZE),), facts.settings, facts.urdf, facts.tool)
        previous: tuple[float, State] | None = None
        while True:
            with self._changed:
                while self._newest is previous:
                    self._changed.wait()
                newest = self._newest
            assert newest is not None
            if previous is None or newest[1] is not previous[1]:
                (pixels,) = studio.taken(newest[1])
                file = io.BytesIO()
                Image.fromarray(pixels).save(file, "jpeg", quality=QUALITY)
            previous = newest
            yield CameraFrame(newest[0], file.getvalue())


def send_states(
    address: PrivateAddress, present: Callable[[], State], is_wanted: Callable[[], bool]
) -> None:
    """Send the state of the arm to the process at ``address`` while it ``is_wanted``, for ever."""
    while True:
        with suppress(*PIPE_ERRORS), connect(address, Greeting(STATES), PERIOD) as connection:
            last = None
            while True:
                time.sleep(PERIOD)
                with suppress(LeaseError):
                    if is_wanted():
                        state = present()
                        # A plan is large, and is not seen.
                        shown = None if state is last else replace(state, mode=IDLE, bodies=None)
                        connection.send(shown)
                        last = state
        time.sleep(PERIOD)
