"""Events of a run that follow from its ticks: stops, who drives, and motions of programs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from katana450.arm.control.lease import CommandChannel
from katana450.arm.control.state.modes import Following
from katana450.arm.control.state.state import State
from katana450.arm.runtime.tick import TickRecord

STOP, CLEAR_STOP, DRIVER, STEP = "stop", "clear_stop", "driver", "step"
"""Kinds of these events."""


class RunEvents:
    """Finds the events of one run, tick by tick."""

    def __init__(self) -> None:
        """Begin before the first tick."""
        self._before: State | None = None
        self._driver = ""

    def of(self, record: TickRecord) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield kind and fields of each event of ``record``, the tick after the last one."""
        for command, actor in record.submissions:
            if actor is None or actor.channel is CommandChannel.SERVER or command.traits.safety:
                continue
            if actor.name != self._driver:
                self._driver = actor.name
                yield DRIVER, {"name": actor.name, "channel": actor.channel.value}
        before, self._before = self._before, record.state
        if before is None:
            return
        yield from _stops(before, record.state)
        was, now = before.following, record.state.following
        if now is not None and now.fraction < 1.0 and _begins(was, now):
            # On the clock of the program: at its speed, and without what is done already.
            seconds = now.plan.duration_at(record.state.speed) * (1.0 - now.fraction)
            yield STEP, {"seconds": seconds}


def _begins(was: Following | None, now: Following) -> bool:
    """Return whether ``now`` is on another plan than ``was``; a later record has a copy of it."""
    return was is None or was.plan.span != now.plan.span or now.tau < was.tau


def _stops(before: State, after: State) -> Iterator[tuple[str, dict[str, Any]]]:
    was, now = before.stopped, after.stopped
    if now is not None and was is None:
        yield STOP, {"why": now.cause.why, "by": now.cause.by}
    elif now is not None and was is not None and was.cause.lacks_name_of(now.cause):
        yield STOP, {"why": now.cause.why, "by": now.cause.by, "named": True}
    elif now is None and was is not None:
        yield CLEAR_STOP, {}
