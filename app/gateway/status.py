"""What a page is told of the arm and of who drives it."""

from __future__ import annotations

from typing import Any

from app.gateway.hub import Hub, Window
from app.view.texts import headline, mood, sentence

AGE_WORTH_TELLING = 0.2
"""[s] A picture that is younger counts as now."""


def common(hub: Hub) -> dict[str, Any]:
    """The part that is the same for all."""
    state = hub.arm.state if hub.arm is not None else None
    stopped = hub.stopped
    now = "starting" if state is None else mood(state)
    if stopped is not None:
        now = "stopped"
    holder = hub.lease.holder
    return {
        "mood": now,
        "headline": "" if state is None else headline(state),
        "why": "" if state is None else sentence(state),
        "stopped": None if stopped is None else stopped.why,
        "holder": None if holder is None else holder.name,
        "speed": 1.0 if state is None else state.speed,
        "windows": len(hub.windows),
    }


def of(hub: Hub, window: Window) -> dict[str, Any]:
    """The part that is its own."""
    person, lease = window.person, hub.lease
    mine = lease.holder == person
    age = hub.age(window)
    return {
        "name": person.name,
        "role": person.role.value,
        "mine": mine,
        "asked": person in lease.waiting,
        "asking": [
            {"number": each.number, "name": each.person.name}
            for each in hub.windows
            if mine and each.person in lease.waiting
        ],
        "others": [
            {"number": each.number, "name": each.person.name}
            for each in hub.windows
            if mine and each.person != person and each.person.role.may_drive
        ],
        "age": round(age, 1) if age >= AGE_WORTH_TELLING else 0,
    }
