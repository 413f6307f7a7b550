"""``katana450 arm probe``: read all of an arm that can be learned without a motion."""

from __future__ import annotations

import json
import statistics
import sys
import time
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from katana450.assembly.log_output import printable
from katana450.atomic import check_writable, write_files, writer_of
from katana450.cli.version import version
from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.host_codec import request_bytes
from katana450.extensions.real_arm.codec.replies import AXES, ArmReply
from katana450.extensions.real_arm.commands.probe_report import report_text
from katana450.extensions.real_arm.link.arm_link import ArmLink
from katana450.extensions.real_arm.link.arm_url import ArmUrl
from katana450.extensions.real_arm.link.transport import ArmRefusalError, LinkLostError

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
    found: list[ArmReply] = []
    refusals: list[str] = []
    times: list[float] = []
    for _ in range(repeats):
        try:
            found.append(link.exchange(request, TIMEOUT))
        except ArmRefusalError as error:
            refusals.append(str(error))
        times.append(link.round_trips[0])
        link.round_trips.clear()
    reading: Report = {"request": request_bytes(request).hex(" "), "times_ms": times_of(times)}
    if found:
        payloads = [reply.payload for reply in found]
        reading["reply"] = payloads[0].hex(" ")
        reading["fields"] = {
            field.name: _plain(getattr(found[0], field.name)) for field in fields(found[0])
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
    ordered = sorted(1e3 * each for each in times)
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
