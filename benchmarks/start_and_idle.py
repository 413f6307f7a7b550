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
import json
import re
import socket
import statistics
import time
import urllib.request
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
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


class Page(NamedTuple):
    """Times of a page [s].

    Attributes:
        usable: until the pixels of the first frame that shows arm and gizmo are there.
        complete: until the panel and hidden nodes are there too.
    """

    usable: float
    complete: float


class Times(NamedTuple):
    """Times in seconds.

    Attributes:
        port: from the command to the open port.
        start: of the page from the command on.
        load: of a page that is loaded when the server runs.
    """

    port: float
    start: Page
    load: Page


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
            # viser probes a port before it serves there, so several connections must succeed.
            for _ in range(4):
                socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
                time.sleep(0.02)
            return
        time.sleep(0.01)
    raise TimeoutError(f"no server listened on port {port} for {OPEN_SECONDS:g} s")


def load(browser: Browser, url: str, nodes: Sequence[str], began: float) -> tuple[ViserPage, Page]:
    """Return a page in which everything is drawn, and its times since ``began`` (`time.time()`)."""
    watch = f"window.whole = harness.firstWhole({json.dumps(nodes)})"
    script = f"""addEventListener("DOMContentLoaded", () => {{
        if (!document.querySelector("iframe#scene")) {watch};
    }});"""
    page = ViserPage.open(browser, url, nodes=nodes, drawing=Drawing.ALWAYS, script=script)
    complete = time.time()
    usable: float = page.frame.evaluate("() => window.whole")
    return page, Page(usable - began, complete - began)


def one_start(browser: Browser, app: str, idle: float) -> tuple[Times, float | None]:
    """Return the times of one start, and the fraction of a core used at rest for ``idle`` [s].

    The fraction is None if ``idle`` is 0.
    """
    command, nodes = APPS[app]
    server = AppServer(command)
    with ThreadPoolExecutor(1) as starter, closing(server):
        started = time.time()
        starting = starter.submit(server.start)
        wait_for_port(server.port)
        port = time.time() - started
        page, start = load(browser, server.url, nodes, started)
        starting.result()
        page.close()
        page, again = load(browser, server.url, nodes, time.time())
        times = Times(port, start, again)
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
                    f"{app:5} port {taken.port:.2f} s  usable {taken.start.usable:.2f} s  "
                    f"complete {taken.start.complete:.2f} s  loaded again: usable "
                    f"{taken.load.usable:.2f} s  complete {taken.load.complete:.2f} s",
                    flush=True,
                )
    table(times)
    for app, fraction in fractions.items():
        print(f"{app}, at rest: {100.0 * (fraction or 0.0):.1f} % of a core")


ROWS: dict[str, Callable[[Times], float]] = {
    "port open": lambda each: each.port,
    "page usable: arm and gizmo drawn": lambda each: each.start.usable,
    "page complete: with its panel": lambda each: each.start.complete,
    "usable, loaded from a running server": lambda each: each.load.usable,
    "complete, loaded from a running server": lambda each: each.load.complete,
}


def table(times: Mapping[str, Sequence[Times]]) -> None:
    """Print the medians, and the median ratio of the pairs."""
    print("| median, s | app | bare app | ratio of pairs |\n|---|--:|--:|--:|")
    for name, value in ROWS.items():
        app, bare = (list(map(value, times[each])) for each in ("app", "bare"))
        ratio = statistics.median(a / b for a, b in zip(app, bare, strict=True))
        print(f"| {name} | {statistics.median(app):.2f} | {statistics.median(bare):.2f} |", end="")
        print(f" {ratio:.2f} |")


if __name__ == "__main__":
    main()
