"""How soon after the command the page is usable, and what the server costs while nobody moves.

    python -m benchmarks.start_and_idle

The app and the bare viser app take turns. The browser is open before the command is given, as a
person's is, and goes to the address as soon as the port is open. CPU time is the server process's
own, over the wall time of the rest, so a busy machine does not count.
"""

from __future__ import annotations

import argparse
import os
import socket
import statistics
import time
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from playwright.sync_api import Browser

from tests.browser.chromium import launched
from tests.browser.page import Drawing, ViserPage
from tests.browser.server import APP, BARE_APP, AppServer

SETTLE_SECONDS = 3.0
OPEN_SECONDS = 30.0
APPS: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "app": (APP, ("/arm", "/target/move")),
    "bare": (BARE_APP, ("/arm/box", "/target/move")),
}


class Times(NamedTuple):
    """Seconds from the command to the open port, and to a page that can be used."""

    port: float
    usable: float


def cpu_seconds(pid: int) -> float:
    """CPU time that a process and its threads have used [s]; Linux only."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait_for_port(port: int) -> None:
    """Return when somebody listens on the port of this machine."""
    deadline = time.monotonic() + OPEN_SECONDS
    while time.monotonic() < deadline:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
        except OSError:
            time.sleep(0.01)
        else:
            return
    raise TimeoutError(f"nobody listened on port {port} for {OPEN_SECONDS:g} s")


def one_start(browser: Browser, app: str, idle: float) -> tuple[Times, float | None]:
    """The times of one start, and the share of a core used at rest if ``idle`` [s] is not 0."""
    command, nodes = APPS[app]
    server = AppServer(command)
    with ThreadPoolExecutor(1) as starter, closing(server):
        started = time.perf_counter()
        starting = starter.submit(server.start)
        wait_for_port(server.port)
        port = time.perf_counter() - started
        page = ViserPage.open(browser, server.url, nodes=nodes, drawing=Drawing.ALWAYS)
        times = Times(port, time.perf_counter() - started)
        starting.result()
        share = None
        if idle:
            time.sleep(SETTLE_SECONDS)
            before = cpu_seconds(server.pid)
            time.sleep(idle)
            share = (cpu_seconds(server.pid) - before) / idle
        page.close()
    return times, share


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=5, help="starts of each (default: 5)")
    parser.add_argument("--idle", type=float, default=20.0, help="seconds at rest (default: 20)")
    options = parser.parse_args()
    times: dict[str, list[Times]] = defaultdict(list)
    shares: dict[str, float | None] = {}
    with launched() as browser:
        for number in range(1, options.starts + 1):
            for app in APPS:
                last = number == options.starts
                taken, shares[app] = one_start(browser, app, options.idle if last else 0.0)
                times[app].append(taken)
                print(f"{app:5} port {taken.port:.2f} s  usable {taken.usable:.2f} s", flush=True)
    for app, all_taken in times.items():
        port = statistics.median(each.port for each in all_taken)
        usable = statistics.median(each.usable for each in all_taken)
        print(f"{app:5} median: port {port:.2f} s, usable page {usable:.2f} s", end="")
        print(f", at rest {100.0 * (shares[app] or 0.0):.1f} % of a core")


if __name__ == "__main__":
    main()
