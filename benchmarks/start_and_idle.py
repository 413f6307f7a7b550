"""Time from the command to a usable page, and the cost of the server while no client moves the arm.

    python -m benchmarks.start_and_idle

The app and the bare viser app take turns. The app is compiled before, as pip compiles what it
installs. The browser is open before the command starts, like that of a person, and opens the
address as soon as the port is open. A second window then loads the page of the running server.
CPU time is that of the server's processes, divided by the wall time at rest, so a busy machine does
not count. For the app the bytes of a page over the wire are printed too.
"""

from __future__ import annotations

import argparse
import asyncio
import compileall
import re
import socket
import statistics
import time
import urllib.request
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from pathlib import Path
from typing import NamedTuple

from playwright.sync_api import Browser

import katana450
from katana450.server.viser_bridge.viser_page import DECODER_FILE, PROGRAM
from tests.browser.camera import Drawing
from tests.browser.chromium import launched
from tests.browser.page import ViserPage
from tests.browser.server import BARE_APP, RECORDING_APP, AppServer
from tests.gateway.client import SUBPROTOCOL, ask, enter, page_name, websocket

SETTLE_SECONDS = 40.0
"""[s] Time before the rest is measured, in which the scripts of the library are planned."""

SCENE_SECONDS = 1.0
"""[s] Silence after which a scene is complete: at rest no more messages come."""
OPEN_SECONDS = 30.0
APPS: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "app": (RECORDING_APP, ("/arm", "/target/move")),
    "bare": (BARE_APP, ("/arm/box", "/target/move")),
}


class Times(NamedTuple):
    """Times in seconds.

    Attributes:
        port: from the command to the open port.
        usable: from the command to a usable page.
        load: of a page load when the server runs.
    """

    port: float
    usable: float
    load: float


def cpu_seconds(pids: Sequence[int]) -> float:
    """Return the CPU time that the present threads of processes have used [s]; Linux only."""
    nanoseconds = 0
    for pid in pids:
        # Exact, unlike the times in `stat`, which are sampled.
        for thread in Path(f"/proc/{pid}/task").iterdir():
            nanoseconds += int((thread / "schedstat").read_text(encoding="ascii").split()[0])
    return 1e-9 * nanoseconds


def over_the_wire(url: str) -> dict[str, int]:
    """Return the bytes of our page and its files, of viser's page, and of the whole scene."""
    cookie = enter(url)
    index = ask(f"{url}/")[2].decode()
    files = ["/", *(f"/{name}" for name in re.findall(r'(?:src|href)="(static/[^"]+)"', index))]
    return {
        "our page": sum(compressed(url + file, cookie) for file in (*files, "/static/link.js")),
        "viser's page": sum(
            compressed(f"{url}/viser/{name}", cookie) for name in ("", PROGRAM, DECODER_FILE)
        ),
        "the scene": asyncio.run(scene_bytes(url, cookie)),
    }


def compressed(url: str, cookie: str) -> int:
    """Return the bytes of the answer to a browser that accepts gzip and zstd."""
    headers = {"Cookie": cookie, "Accept-Encoding": "gzip, zstd"}
    with urllib.request.urlopen(
        urllib.request.Request(url, headers=headers), timeout=SCENE_SECONDS
    ) as answer:
        return len(answer.read())


async def scene_bytes(url: str, cookie: str) -> int:
    """Return the bytes that a browser receives until the scene is complete."""
    path, taken = f"/viser?page={page_name()}", 0
    async with websocket(url, path, cookie, subprotocols=[SUBPROTOCOL]) as socket:
        with suppress(TimeoutError):
            while True:
                taken += len(await asyncio.wait_for(socket.recv(), SCENE_SECONDS))
    return taken


def wait_for_port(port: int) -> None:
    """Wait until a server listens steadily on the port of this machine."""
    deadline = time.monotonic() + OPEN_SECONDS
    while time.monotonic() < deadline:
        with suppress(OSError):
            # viser probes a port before it serves there, so two connections must succeed.
            for _ in range(2):
                socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
                time.sleep(0.02)
            return
        time.sleep(0.01)
    raise TimeoutError(f"no server listened on port {port} for {OPEN_SECONDS:g} s")


class SeenPage(ViserPage):
    """A page that is ready when arm and gizmo are drawn; the panel may follow."""

    waits_for_panel = False


def opened(browser: Browser, url: str, nodes: Sequence[str]) -> ViserPage:
    """Return a page in which arm and gizmo are drawn."""
    return SeenPage.open(browser, url, nodes=nodes, drawing=Drawing.ALWAYS)


def one_start(browser: Browser, app: str, idle: float) -> tuple[Times, float | None]:
    """Return the times of one start, and the fraction of a core used at rest for ``idle`` [s].

    The fraction is None if ``idle`` is 0.
    """
    command, nodes = APPS[app]
    server = AppServer(command)
    with ThreadPoolExecutor(1) as starter, closing(server):
        started = time.perf_counter()
        starting = starter.submit(server.start)
        wait_for_port(server.port)
        port = time.perf_counter() - started
        page = opened(browser, server.url, nodes)
        usable = time.perf_counter() - started
        starting.result()
        page.close()
        began = time.perf_counter()
        page = opened(browser, server.url, nodes)
        times = Times(port, usable, time.perf_counter() - began)
        fraction = None
        if idle:
            time.sleep(SETTLE_SECONDS)
            pids = [server.pid]
            if app == "app":
                pids += [server.front, server.arm, server.stop_process]
                pids.append(server.child("katana450 rec"))
            before = cpu_seconds(pids)
            time.sleep(idle)
            fraction = (cpu_seconds(pids) - before) / idle
            if app == "app":
                print("over the wire:", end=" ")
                # This thread runs Playwright's loop.
                sizes = starter.submit(over_the_wire, server.url).result().items()
                print(", ".join(f"{name} {size / 1e3:.0f} kB" for name, size in sizes))
        page.close()
    return times, fraction


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=5, help="starts of each (default: 5)")
    parser.add_argument("--idle", type=float, default=20.0, help="seconds at rest (default: 20)")
    options = parser.parse_args()
    times: dict[str, list[Times]] = defaultdict(list)
    fractions: dict[str, float | None] = {}
    # A checkout is compiled at its first start, and never where PYTHONDONTWRITEBYTECODE is set.
    compileall.compile_dir(Path(katana450.__file__).parent, quiet=1)
    with launched() as browser:
        for number in range(1, options.starts + 1):
            for app in APPS:
                last = number == options.starts
                taken, fractions[app] = one_start(browser, app, options.idle if last else 0.0)
                times[app].append(taken)
                print(
                    f"{app:5} port {taken.port:.2f} s  usable {taken.usable:.2f} s  "
                    f"loaded again {taken.load:.2f} s",
                    flush=True,
                )
    for app, all_taken in times.items():
        port = statistics.median(each.port for each in all_taken)
        usable = statistics.median(each.usable for each in all_taken)
        load = statistics.median(each.load for each in all_taken)
        print(f"{app:5} median: port {port:.2f} s, usable page {usable:.2f} s", end="")
        print(f", loaded again {load:.2f} s", end="")
        print(f", at rest {100.0 * (fractions[app] or 0.0):.1f} % of a core")


if __name__ == "__main__":
    main()
