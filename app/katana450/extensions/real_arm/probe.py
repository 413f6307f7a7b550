"""``katana450 arm probe``: read all of an arm that can be learned without a motion."""

from __future__ import annotations

import json
import statistics
import sys
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from katana450.assembly.log_output import printable
from katana450.atomic import check_writable, write_files, writer_of
from katana450.cli.version import version
from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.codecs import request_bytes
from katana450.extensions.real_arm.codec.replies import AXES, ArmReply, status_words
from katana450.extensions.real_arm.link import ArmLink, ArmRefusalError, ArmUrl, LinkLostError

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
    yield from (f"  {sentence}" for sentence in NOT_LEARNED)


def _notes(reading: Report) -> str:
    notes = ""
    if reading.get("refused"):
        notes += f"  refused {reading['refused']} times: {reading['refusal']}"
    if reading.get("bytes_that_changed"):
        notes += f"  changing bytes: {reading['bytes_that_changed']}"
    return notes


def _findings(readings: Report) -> Iterator[str]:
    """Return a line for each reading that answers an open question."""
    contents = {
        name: reading["fields"] for name, reading in readings.items() if "fields" in reading
    }
    if "master firmware" in contents:
        master = contents["master firmware"]
        yield f"Master firmware: {master['version']}.{master['revision']}"
    if "identity" in contents:
        yield f"Identity: {contents['identity']['text'].strip()}"
    for name in contents:
        if name.startswith("slave firmware"):
            yield f"{name.capitalize()}: {readings[name]['reply']} (bytes 2, 7 to 12: unknown)"
    if "command table" in contents:
        yield f"Command table: {readings['command table']['reply']}"
    if "states" in contents:
        for axis, status in enumerate(contents["states"]["states"], 1):
            yield f"State of axis {axis}: {status} ({status_words(status)})"
    if "positions" in contents:
        yield f"Encoders: {contents['positions']['positions']}"
    for name, values in contents.items():
        if name.startswith("axis "):
            drive = f"velocity {values['velocity']}, pwm {values['pwm']}"
            yield f"{name.capitalize()} at rest: {drive}"
    if "sensors" in contents:
        yield f"Sensors without contact: {contents['sensors']['values']}"
    if "digital inputs" in contents:
        yield f"Digital inputs: {contents['digital inputs']['bits']:08b}"


TIMEOUT = 2.0
"""[s] Longest time for which the probe waits for a reply: an unknown arm may be slow."""

FACTS: tuple[tuple[str, req.ArmRequest], ...] = (
    ("master firmware", req.ReadMasterVersion()),
    ("identity", req.ReadArmIdentity()),
    *((f"slave firmware {axis}", req.ReadSlaveVersion(axis)) for axis in range(1, AXES + 1)),
    ("command table", req.ReadCommandTable()),
)
"""Readings that do not change, by their names in the report."""

MEASUREMENTS: tuple[tuple[str, req.ArmRequest], ...] = (
    ("states", req.ReadStates()),
    ("positions", req.ReadPositions()),
    *((f"axis {axis}", req.ReadAxis(axis)) for axis in range(1, AXES + 1)),
    ("sensors", req.ReadSensors()),
    ("digital inputs", req.ReadInputs()),
)
"""Readings that may change."""

Report = dict[str, Any]


def probe(options: Namespace) -> int:
    """Run ``katana450 arm probe``; return the exit status: 1 if the arm stopped answering."""
    url = ArmUrl.parse(options.url)
    path: Path = options.out or Path(time.strftime("arm-probe-%Y%m%d-%H%M%S.json"))
    check_writable(path)
    report: Report = {
        "katana450": version(),
        "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "address": str(url),
        "repeats": options.repeat,
        "readings": {},
    }
    lost = ""
    try:
        read_arm(ArmLink(url.open()), options.repeat, report["readings"])
    except LinkLostError as error:
        lost = report["lost"] = str(error)
    text = report_text(report)
    words = path.with_suffix(".txt")
    content = json.dumps(report, indent=2) + "\n"
    write_files({path: writer_of(content.encode()), words: writer_of(text.encode())})
    print(printable_lines(text))
    print(f"Written: {path} and {words}")
    if lost:
        print(f"katana450: {lost}", file=sys.stderr)
    return int(bool(lost))


def read_arm(link: ArmLink, repeats: int, readings: Report) -> None:
    """Fill ``readings`` with each reading and its reply times. Raises LinkLostError."""
    try:
        for name, request in (*FACTS, *MEASUREMENTS):
            readings[name] = _read(link, request, repeats)
    finally:
        link.close()


def _read(link: ArmLink, request: req.ArmRequest, repeats: int) -> Report:
    """Return the first reply, how the others differ, and the times of all."""
    link.round_trips.clear()
    replies: list[ArmReply] = []
    refusals: list[str] = []
    times: list[float] = []
    for _ in range(repeats):
        try:
            replies.append(link.exchange(request, TIMEOUT))
        except ArmRefusalError as error:
            refusals.append(str(error))
        times.append(link.round_trips[0])
        link.round_trips.clear()
    reading: Report = {"request": request_bytes(request).hex(" "), "times_ms": times_of(times)}
    if replies:
        payloads = [reply.payload for reply in replies]
        reading["reply"] = payloads[0].hex(" ")
        reading["fields"] = {
            name: _plain(value) for name, value in msgspec.structs.asdict(replies[0]).items()
        }
        reading["bytes_that_changed"] = [
            place
            for place, values in enumerate(zip(*payloads, strict=True))
            if len(set(values)) > 1
        ]
    if refusals:
        reading["refused"], reading["refusal"] = len(refusals), refusals[0]
    return reading


def times_of(times: Sequence[float]) -> Report:
    """Return minimum, median, 95th percentile and maximum of ``times`` [s], in ms."""
    ordered = sorted(1e3 * t for t in times)
    return {
        "min": round(ordered[0], 3),
        "median": round(statistics.median(ordered), 3),
        "p95": round(ordered[min(int(0.95 * len(ordered)), len(ordered) - 1)], 3),
        "max": round(ordered[-1], 3),
    }


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return value.decode("ascii") if value.isascii() and value.strip(b"\0") else value.hex(" ")
    return list(value) if isinstance(value, tuple) else value


def printable_lines(text: str) -> str:
    """Return ``text`` without control characters other than the ends of its lines."""
    return "\n".join(map(printable, text.splitlines()))
