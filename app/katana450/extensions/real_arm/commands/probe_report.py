"""The report of a probe in words: what was learned, and what cannot be learned by reading."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from katana450.extensions.real_arm.codec.axis_status import status_words

Report = Mapping[str, Any]

NOT_LEARNED = (
    "whether `C` echoes its flag: any `C` is an order to a motor",
    "the exact error of an uncalibrated arm: it answers an order to move",
    "the depth of the buffer of polynomials: it fills only while the arm moves",
    "the unit of the drive (pwm): it is known at rest only",
    "the scale of the sensors: press and approach them by hand, and probe again",
    "what the arm does when the connection is lost in a motion; assume that it continues",
    "the counts of axis 3, the sign of speeds, and the place where a calibration ends",
    "the answers to a wrong checksum, to two requests at once, and to a second client",
)
"""Open questions that a reading cannot answer."""


def report_text(report: Report) -> str:
    """Return the report in words, one line each."""
    return "\n".join(_lines(report)) + "\n"


def _lines(report: Report) -> Iterator[str]:
    yield f"Probe of the arm at {report['address']}, {report['time']}, read only."
    if "lost" in report:
        yield f"The arm stopped answering: {report['lost']}"
    yield ""
    yield "Reply times in ms: minimum, median, 95 %, maximum"
    readings = report["readings"]
    for name, reading in readings.items():
        times = reading["times_ms"]
        numbers = "".join(f"{times[key]:9.2f}" for key in ("min", "median", "p95", "max"))
        yield f"  {name:18}{numbers}{_notes(reading)}"
    yield ""
    yield from _findings(readings)
    yield ""
    yield "Not learned, because it needs more than reading:"
    yield from (f"  {each}" for each in NOT_LEARNED)


def _notes(reading: Report) -> str:
    notes = ""
    if reading.get("refused"):
        notes += f"  refused {reading['refused']} times: {reading['refusal']}"
    if reading.get("bytes_that_changed"):
        notes += f"  changing bytes: {reading['bytes_that_changed']}"
    return notes


def _findings(readings: Report) -> Iterator[str]:
    """Return a line for each reading that answers an open question."""
    found = {name: each["fields"] for name, each in readings.items() if "fields" in each}
    if "master firmware" in found:
        master = found["master firmware"]
        yield f"Master firmware: {master['version']}.{master['revision']}"
    if "identity" in found:
        yield f"Identity: {found['identity']['text'].strip()}"
    for name in found:
        if name.startswith("slave firmware"):
            yield f"{name.capitalize()}: {readings[name]['reply']} (bytes 2, 7 to 12: unknown)"
    if "command table" in found:
        yield f"Command table: {readings['command table']['reply']}"
    if "states" in found:
        for axis, status in enumerate(found["states"]["states"], 1):
            yield f"State of axis {axis}: {status} ({status_words(status)})"
    if "positions" in found:
        yield f"Encoders: {found['positions']['positions']}"
    for name, values in found.items():
        if name.startswith("axis "):
            drive = f"velocity {values['velocity']}, pwm {values['pwm']}"
            yield f"{name.capitalize()} at rest: {drive}"
    if "sensors" in found:
        yield f"Sensors without contact: {found['sensors']['values']}"
    if "digital inputs" in found:
        yield f"Digital inputs: {found['digital inputs']['bits']:08b}"
