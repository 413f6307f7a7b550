"""What a page is told of the arm and of who drives it."""

from __future__ import annotations

from typing import Any, NamedTuple

from app.gateway.hub import Hub, Window
from app.view.texts import headline, mood, sentence

NO_STATE = 0.3
"""[s] Without a word of the arm's process, after which its state counts as unknown."""

AGE_WORTH_TELLING = 0.2
"""[s] A picture that is younger counts as now."""


class _Headline(NamedTuple):
    mood: str
    headline: str
    why: str


def silence(hub: Hub) -> float | None:
    """Time since the arm's process last answered [s], once it is longer than NO_STATE."""
    age = 0.0 if hub.arm is None else hub.arm.age
    return age if age > NO_STATE else None


def health(hub: Hub) -> str | None:
    """What is wrong with the server, in words; None when it is well."""
    if hub.arm is None:
        return "The arm is not there yet."
    age = silence(hub)
    return None if age is None else f"No word from the arm's process for {age:.1f} s."


def common(hub: Hub) -> dict[str, Any]:
    """The part that is the same for all."""
    state = hub.arm.state if hub.arm is not None else None
    stopped, holder, age = hub.stopped, hub.lease.holder, silence(hub)
    now = _Headline("starting", "Starting", "")
    if state is not None:
        now = _Headline(mood(state), headline(state), sentence(state))
    if stopped is not None:
        now = _Headline("stopped", "Stopped", "")
    if age is not None:
        now = _Headline("lost", "No word from the arm", f"What is shown is {age:.1f} s old.")
    if stopped is not None and not stopped.confirmed:
        why = f"The arm has not confirmed it. {now.why}".rstrip()
        now = _Headline("stopping", "Stop requested", why)
    return {
        **now._asdict(),
        "stop": None if stopped is None else stopped.stage,
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
    resets = hub.may_reset(window)
    other = lease.holder.name if lease.holder is not None else "whoever may drive"
    until = "Reset" if resets else f"{other} resets it"
    return {
        "resets": resets,
        "until": "" if hub.stopped is None else f"Nothing moves until {until}.",
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
