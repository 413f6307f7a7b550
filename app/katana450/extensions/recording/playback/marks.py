"""Marks of a timeline: what happened, from the events and episodes of a recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from katana450.arm.control.commands.motion_commands import OWN_RUN
from katana450.arm.control.lease import CommandChannel
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import Finding, Reason
from katana450.extensions.recording.files import attempts
from katana450.extensions.recording.files.recording_file import Message
from katana450.extensions.recording.forms import FormError, json_form
from katana450.extensions.recording.live import ring
from katana450.extensions.recording.messages import EPISODES

MAX_TEXT = 120
"""Maximum number of letters of the text of a mark."""

NAMED = "named"
"""Kind of a mark that is not shown: the last stop with the name of its presser."""

REPEATED = 1.0
"""[s] Time in which a mark with the same text is left out."""

TOUCHED = 10.0
"""[s] The same for a contact of the same parts, however near they are."""

SAME_BEGIN = 5.0
"""[s] Time after the begin of a script in which the arm moves first, if the mark is that begin."""

WITHOUT_MARK = frozenset((Reason.STOPPED, Reason.PAUSED, Reason.WAITING))
"""Reasons that another event reports, or that limit nothing."""


class Mark(NamedTuple):
    """A mark at ``t`` [s].

    Its ``kind`` is stop, clear_stop, driver, program, step, restore, contact, limit or
    episode.
    """

    t: float
    kind: str
    text: str


def add_marks(marks: list[Mark], messages: Iterable[Message]) -> None:
    """Add the marks of ``messages`` of events and episodes to the earlier ``marks``.

    Repetitions are left out, and a stop that is named later is named.
    """
    for mark in _all(messages):
        if mark.kind == NAMED:
            stops = [number for number, old in enumerate(marks) if old.kind == ring.STOP]
            if stops:
                marks[stops[-1]] = marks[stops[-1]]._replace(text=mark.text)
            continue
        time = TOUCHED if mark.kind == "contact" else REPEATED
        again = (old for old in reversed(marks) if mark.t - old.t < time)
        words = mark._replace(t=0.0, text=mark.text.partition(" are ")[0])
        if words not in (old._replace(t=0.0, text=old.text.partition(" are ")[0]) for old in again):
            marks.append(mark)


def _all(messages: Iterable[Message]) -> Iterator[Mark]:
    for message in messages:
        try:
            form = json_form(message.data)
        except FormError:
            continue
        if not isinstance(form, dict):
            continue
        kind = form.get("kind")
        words = (
            ("episode", _episode(form)) if message.topic == EPISODES else _event(str(kind), form)
        )
        if words is not None:
            yield Mark(message.t, words[0], words[1][:MAX_TEXT])


def _event(kind: str, form: Mapping[str, Any]) -> tuple[str, str] | None:
    match kind:
        case ring.STOP:
            return NAMED if form.get("named") else kind, str(form.get("why") or "Stopped")
        case ring.CLEAR_STOP:
            return kind, "Stop cleared"
        case attempts.DRIVER if form.get("channel") != CommandChannel.PROGRAM.value:
            return kind, f"{form.get('name')} drives"
        case attempts.RESTORE:
            return kind, _restored(form)
        case "program":
            return _program(form)
        case ring.STEP:
            seconds = form.get("seconds")
            length = f" of {seconds:.1f} s" if isinstance(seconds, int | float) else ""
            return kind, f"Planned motion{length}"
        case "finding" if form.get("began") is True:
            return _finding(form)
        case _:
            return None


def _restored(form: Mapping[str, Any]) -> str:
    t, since = form.get("t"), form.get("since")
    if not (isinstance(t, int | float) and isinstance(since, int | float)):
        return "Continues from another moment"
    if form.get("recording") not in OWN_RUN:
        return f"Continues from {since:.1f} s of a file"
    return f"Continues from {_duration(t - since)} earlier"


def _duration(seconds: float) -> str:
    """Return a time [s] in words."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def _program(form: Mapping[str, Any]) -> tuple[str, str] | None:
    t, since = form.get("t"), form.get("since")
    if not (isinstance(t, int | float) and isinstance(since, int | float)):
        return None
    if form.get("began") is not True:
        return "program", f"Script {form.get('name')} ends after {t - since:.0f} s"
    # Each file names the runs that began before it.
    is_new = t - since < SAME_BEGIN
    return ("program", f"Script {form.get('name')} begins") if is_new else None


def _finding(form: Mapping[str, Any]) -> tuple[str, str] | None:
    try:
        reason = Reason(form.get("reason"))
    except ValueError:
        return None
    if reason in WITHOUT_MARK:
        return None
    kind = "contact" if reason is Reason.CONTACT else "limit"
    axis, parts, amount = form.get("axis"), form.get("parts"), form.get("amount")
    try:
        finding = Finding(
            reason,
            float(amount or 0.0),
            None if axis is None else int(axis) - 1,
            None if parts is None else (str(parts[0]), str(parts[1])),
        )
        return kind, finding_text(finding)
    except (TypeError, ValueError, LookupError):
        return kind, reason.value


def _episode(form: Mapping[str, Any]) -> str:
    name, kind, task = f"Episode {form.get('number')}", form.get("kind"), form.get("task")
    if kind == "begun":
        return f"{name} begins: {task}" if task else f"{name} begins"
    return f"{name} ends" if kind == "ended" else f"{name}: {form.get('outcome')}, {kind}"
