"""Fingers on the screen of a phone, as real touch events."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import CDPSession, Locator, Page

Place = tuple[float, float]


class Fingers:
    """The touching fingers by their numbers, at pixels of the window."""

    def __init__(self, page: Page, session: CDPSession) -> None:
        self._page = page
        self._session = session
        self._down: dict[int, Place] = {}

    def put(self, place: Place, finger: int = 0) -> None:
        """Put a finger down at ``place``."""
        self._down[finger] = place
        self._send("touchStart")

    def move(self, place: Place, finger: int = 0, *, seconds: float = 0.4, steps: int = 12) -> None:
        """Move a finger in a straight line to ``place``."""
        start = self._down[finger]
        for step in range(1, steps + 1):
            done = step / steps
            x, y = (a + done * (b - a) for a, b in zip(start, place, strict=True))
            self._down[finger] = (x, y)
            self._send("touchMove")
            self._page.wait_for_timeout(1000.0 * seconds / steps)

    def lift(self, finger: int = 0) -> None:
        """Lift a finger."""
        lifted = {finger: self._down.pop(finger)}
        self._send("touchEnd", lifted)

    def _send(self, kind: str, fingers: dict[int, Place] | None = None) -> None:
        touching = self._down if fingers is None else fingers
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in touching.items()]
        event = {"type": kind, "touchPoints": points}
        self._session.send("Input.dispatchTouchEvent", event)


@contextmanager
def fingers(page: Page) -> Iterator[Fingers]:
    """Return the fingers of the person at ``page``."""
    session = page.context.new_cdp_session(page)
    try:
        yield Fingers(page, session)
    finally:
        session.detach()


def middle(element: Locator) -> Place:
    """Return the pixel of the window in the middle of ``element``."""
    box = element.bounding_box()
    assert box is not None, f"{element} is not shown"
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
