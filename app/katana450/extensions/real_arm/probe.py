"""``katana450 arm probe``: read all of an arm that can be learned without a motion."""

from __future__ import annotations

import json
import statistics
import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import msgspec

from katana450.assembly.log_output import printable
from katana450.atomic import check_writable, write_files, writer_of
from katana450.cli.version import version
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.codecs import request_bytes
from katana450.extensions.real_arm.codec.replies import AXES, ArmReply
from katana450.extensions.real_arm.link import (
    PORT,
    ArmLink,
    ArmRefusalError,
    LinkLostError,
    open_arm,
)

TIMEOUT = 2.0
"""[s] Longest time for which the probe waits for a reply: an unknown arm may be slow."""

REPEATS = 50
"""Number of times that each reading is repeated for its reply time."""

READINGS: tuple[tuple[str, req.ArmRequest], ...] = (
    ("master firmware", req.ReadMasterVersion()),
    ("identity", req.ReadArmIdentity()),
    *((f"slave firmware {axis}", req.ReadSlaveVersion(axis)) for axis in range(1, AXES + 1)),
    ("states", req.ReadStates()),
    ("positions", req.ReadPositions()),
    *((f"axis {axis}", req.ReadAxis(axis)) for axis in range(1, AXES + 1)),
    ("sensors", req.ReadSensors()),
)
"""Readings by their names in the report."""

Report = dict[str, Any]


def probe(options: Namespace) -> int:
    """Run ``katana450 arm probe``; return the exit status: 1 if the arm stopped answering."""
    url = DeviceAddress.parse(options.url, PORT)
    path: Path = options.out or Path(time.strftime("arm-probe-%Y%m%d-%H%M%S.json"))
    check_writable(path)
    readings: Report = {}
    report: Report = {
        "katana450": version(),
        "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "address": str(url),
        "repeats": REPEATS,
        "readings": readings,
    }
    try:
        read_arm(ArmLink(open_arm(url)), readings)
    except LinkLostError as error:
        report["lost"] = str(error)
    write_files({path: writer_of((json.dumps(report, indent=2) + "\n").encode())})
    print("Median of the reply times, and the first reply:")
    for name, reading in readings.items():
        content = reading.get("fields", reading.get("refusal"))
        print(printable(f"{name:17} {reading['times_ms']['median']:8.2f} ms  {content}"))
    print(f"Written: {path}")
    if "lost" in report:
        print(f"katana450: {report['lost']}", file=sys.stderr)
    return int("lost" in report)


def read_arm(link: ArmLink, readings: Report) -> None:
    """Fill ``readings`` with each reading and its reply times. Raises LinkLostError."""
    try:
        for name, request in READINGS:
            readings[name] = _read(link, request)
    finally:
        link.close()


def _read(link: ArmLink, request: req.ArmRequest) -> Report:
    """Return the first reply, how the others differ, and the times of all [ms]."""
    replies: list[ArmReply] = []
    refusals: list[str] = []
    times: list[float] = []
    for _ in range(REPEATS):
        link.round_trips.clear()
        try:
            replies.append(link.exchange(request, TIMEOUT))
        except ArmRefusalError as error:
            refusals.append(str(error))
        times.append(round(1e3 * link.round_trips[0], 3))
    reading: Report = {
        "request": request_bytes(request).hex(" "),
        "times_ms": {"min": min(times), "median": statistics.median(times), "max": max(times)},
    }
    if replies:
        payloads = [reply.payload for reply in replies]
        fields = msgspec.structs.asdict(replies[0])
        reading["reply"] = payloads[0].hex(" ")
        reading["fields"] = {name: _plain(value) for name, value in fields.items()}
        columns = enumerate(zip(*payloads, strict=True))
        reading["bytes_that_changed"] = [place for place, values in columns if len({*values}) > 1]
    if refusals:
        reading["refused"], reading["refusal"] = len(refusals), refusals[0]
    return reading


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return value.decode("ascii") if value.isascii() and value.strip(b"\0") else value.hex(" ")
    return list(value) if isinstance(value, tuple) else value
