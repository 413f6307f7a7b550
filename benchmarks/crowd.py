"""Effect of watchers on the driver: time from mouse event to drawn frame, alone and in a crowd.

    python -m benchmarks.crowd

One person drags the gizmo in a real Chromium, alternately alone and with 31 watchers, on one server
and in one run. The watchers receive every picture and acknowledge it 30 times a second. They run in
a separate process on the same machine. Times as in `benchmarks.drag_to_frame`.
"""

from __future__ import annotations

import argparse
import asyncio
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks.drag_to_frame import SPANS, Side, open_side
from benchmarks.load import watch
from tests.browser.chromium import launched
from tests.browser.server import APP

WATCHERS = 31
SETTLE = 6.0
"""[s] Time in which the watchers receive the scene."""

ROOT = Path(__file__).resolve().parents[1]


async def gather(url: str, count: int) -> None:
    """Watch until standard input ends; then print the pictures per second of each watcher."""
    pictures = [0]
    tasks = [asyncio.create_task(watch(url, pictures)) for _ in range(count)]
    await asyncio.sleep(SETTLE)
    print("watching", flush=True)
    before, since = pictures[0], time.monotonic()
    await asyncio.to_thread(sys.stdin.read)
    rate = (pictures[0] - before) / count / (time.monotonic() - since)
    print(f"{rate:.1f}", flush=True)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def block(side: Side, moves: int) -> dict[str, list[float]]:
    """Return the times [ms] of ``moves`` moves, after one that does not count."""
    side.move()
    timed = [side.move() for _ in range(moves)]
    return {span: [each[span] for each in timed] for span in SPANS}


def crowded(side: Side, url: str, moves: int) -> tuple[dict[str, list[float]], float]:
    """Return the same times in a crowd, and the pictures per second that each watcher received."""
    command = [sys.executable, "-m", "benchmarks.crowd", "--url", url]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as crowd:
        assert crowd.stdin is not None
        assert crowd.stdout is not None
        if crowd.stdout.readline().strip() != "watching":
            raise SystemExit("the watchers did not connect")
        times = block(side, moves)
        crowd.stdin.close()
        return times, float(crowd.stdout.readline())


def main() -> None:
    """Measure in turns and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--moves", type=int, default=20, help="a turn (default: 20)")
    parser.add_argument("--turns", type=int, default=3, help="of each kind (default: 3)")
    parser.add_argument("--url", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.url is not None:
        asyncio.run(gather(options.url, WATCHERS))
        return
    alone: dict[str, list[float]] = {span: [] for span in SPANS}
    among: dict[str, list[float]] = {span: [] for span in SPANS}
    rates = []
    with ExitStack() as stack:
        browser = stack.enter_context(launched())
        side = open_side(stack, browser, APP, ["/arm", "/ghost"], "x")
        url = "/".join(side.page.page.url.split("/")[:3])
        for _ in range(options.turns):
            for span, times in block(side, options.moves).items():
                alone[span] += times
            found, rate = crowded(side, url, options.moves)
            rates.append(rate)
            for span, times in found.items():
                among[span] += times
            time.sleep(1.0)
    print(f"{len(alone['drawn'])} moves each, by turns; {WATCHERS} watchers saw", end=" ")
    print(f"{min(rates):.1f} to {max(rates):.1f} pictures a second each")
    print(f"{'':18}{'alone, ms':>16}{'crowd, ms':>16}{'crowd / alone':>16}")
    print(f"{'':18}" + f"{'p50':>8}{'p95':>8}" * 3)
    for span, title in SPANS.items():
        a, b = (np.percentile(each[span], (50, 95)) for each in (alone, among))
        numbers = "".join(f"{each:8.1f}" for each in (*a, *b))
        print(f"{title:18}{numbers}" + "".join(f"{each:8.2f}" for each in b / a))


if __name__ == "__main__":
    main()
