"""What a page is told of the arm and of who drives it."""

from __future__ import annotations

from typing import Any, NamedTuple

from katana450.arm.control.messages import headline, mood, sentence
from katana450.arm.control.state import State, Status
from katana450.server.api.answers import Progress
from katana450.server.api.fields import Order
from katana450.server.service.hub import Hub, Window
from katana450.server.service.program_planning import Stage
from katana450.server.service.steering import RUNS

NO_STATE = 0.3
"""[s] Without a word of the arm's process, after which its state counts as unknown."""

AGE_WORTH_TELLING = 0.2
"""[s] A picture that is younger counts as now."""

PLANNING = "planning"
"""The mood of the page while a program is planned."""


class _Line(NamedTuple):
    """The state line of the page: the colour of its lamp, two or three words, one sentence."""

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


def _line(state: State, program: Progress | None, *, waits: bool) -> _Line:
    """``waits``: whether the program runs as soon as it is planned."""
    line = _Line(mood(state), headline(state), sentence(state))
    first = state.status in (Status.FAULT, Status.STOPPED, Status.BLOCKED)
    if program is None or first:
        return line
    step = f"Step {program.step} of {program.steps}"
    if program.status in RUNS:
        if state.paused:
            return line._replace(headline=f"{program.name}, paused", why=f"{step}. {line.why}")
        return line._replace(mood="moving", headline=f"{program.name}, {step.lower()}")
    if program.status != Stage.PLANNING.value:
        return line
    said = f"Planning {program.name or 'the script'}"
    about = [program.why] if program.why else []
    if program.steps:
        about.append(f"{step}: {program.task}, {program.share:.0%}.")
    if state.moving:
        return line._replace(why=" ".join((f"{said}.", *about)))
    said += ", paused" if state.paused else f" {program.share:.0%}"
    if waits:
        about.append("Then it waits for Resume." if state.paused else "Then it runs.")
    else:
        about.append("It does not run by itself.")
    return _Line(PLANNING, said, " ".join(about))


def _orders(hub: Hub, window: Window) -> list[Order]:
    """What the bar lets this window tell the program that is planned or runs."""
    program, performer = hub.performer.told(), hub.performer
    if program is None or hub.arm is None or not performer.owns(window):
        return []
    pause = [Order.RESUME if hub.arm.state.paused else Order.PAUSE] if hub.stopped is None else []
    if program.status == Stage.PLANNING.value:
        return [*(pause if performer.waits else []), Order.END]
    return [*pause, Order.END] if program.status in RUNS else []


def common(hub: Hub) -> dict[str, Any]:
    """The part that is the same for all."""
    state = hub.arm.state if hub.arm is not None else None
    stopped, holder, age = hub.stopped, hub.lease.holder, silence(hub)
    now = _Line("starting", "Starting", "")
    if state is not None:
        now = _line(state, hub.performer.told(), waits=hub.performer.waits)
    if stopped is not None:
        now = _Line("stopped", "Stopped", "")
    if age is not None:
        now = _Line("lost", "No word from the arm", f"What is shown is {age:.1f} s old.")
    if stopped is not None and not stopped.confirmed:
        why = f"The arm has not confirmed it. {now.why}".rstrip()
        now = _Line("stopped", "Stop requested", why)
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
    # The owner of a program decides while the program drives.
    decides = hub.performer.drives(window)
    program = hub.performer.told()
    taker = hub.taken_by(window)
    age = hub.age(window)
    clears = hub.may_clear_stop(window)
    other = lease.holder.name if lease.holder is not None else "whoever may drive"
    until = "Clear stop is pressed" if clears else f"{other} clears the stop"
    return {
        "may_clear_stop": clears,
        "until": "" if hub.stopped is None else f"Nothing moves until {until}.",
        "name": person.name,
        "role": person.role.value,
        "mine": mine,
        "asked": person in lease.waiting,
        "asking": [
            {"number": each.number, "name": each.person.name}
            for each in hub.windows
            if decides and each.person in lease.waiting
        ],
        "others": [
            {"number": each.number, "name": each.person.name}
            for each in hub.windows
            if mine and each.person != person and each.person.role.may_drive
        ],
        "taken": "" if taker is None else f"{taker} took over from you.",
        "planning": program is not None and program.status == Stage.PLANNING.value,
        "orders": [order.value for order in _orders(hub, window)],
        "age": round(age, 1) if age >= AGE_WORTH_TELLING else 0,
    }
