"""Time from the browser's mouse event to the drawn frame: the app beside a bare viser app.

A real Chromium drags the gizmos of both in turn, in one run, so that both meet the same conditions.
Two times are measured for each move, from the time stamp of the browser's mouse event. The first
ends at the decoded message with a new pose of a watched node. The second ends with the first frame
that shows a watched node in a new pose. WebGL's draw calls are left out, because without a graphics
card they take longer than all the rest; the scene graph is updated as usual.
"""

from __future__ import annotations

import argparse
import json
import random
import shlex
from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser

from tests.browser.chromium import launched
from tests.browser.grip import Grip
from tests.browser.page import Axis, ViserPage
from tests.browser.server import APP, BARE_APP, AppServer

SCRIPT = Path(__file__).with_suffix(".js")
GIZMO = "/target/move"
WARM_UP = 5
STRIDE = 0.01  # m; each move goes this far, out and back
QUIET_MILLISECONDS = 150.0  # longer than viser's 50 ms between two updates of a gizmo
SPANS = {"message": "event → message", "drawn": "event → frame"}


@dataclass
class Side:
    """One of the two apps, and its times in milliseconds."""

    page: ViserPage
    grip: Grip
    times: dict[str, list[float]]
    moves: int = 0

    def move(self) -> dict[str, float]:
        """Move the gizmo once and return the milliseconds of each span."""
        self.page.frame.evaluate("(quiet) => harness.arm(quiet)", QUIET_MILLISECONDS)
        # Otherwise all moves would have the same phase relative to the server's clocks.
        self.page.page.wait_for_timeout(random.uniform(0.0, 50.0))
        self.moves += 1
        self.grip.to(STRIDE * (self.moves % 2))
        timed: dict[str, float] = self.page.frame.evaluate("() => harness.timed()")
        return timed


def open_side(
    stack: ExitStack, browser: Browser, command: Sequence[str], prefixes: list[str], axis: Axis
) -> Side:
    """Start an app, open a window on it and grip an arrow of its gizmo."""
    server = stack.enter_context(AppServer(command))
    page = stack.enter_context(closing(ViserPage.open(browser, server.url, nodes=[GIZMO])))
    page.frame.evaluate(SCRIPT.read_text(encoding="utf-8"))
    if not page.frame.evaluate("(prefixes) => harness.watch(prefixes)", prefixes):
        raise SystemExit(f"`{shlex.join(command)}` shows no node under {' or '.join(prefixes)}")
    grip = stack.enter_context(page.grip_arrow(GIZMO, axis))
    return Side(page, grip, {span: [] for span in SPANS})


def measure(sides: Sequence[Side], moves: int) -> None:
    """Add the times of each side; the sides move in turn, in random order."""
    for number in range(WARM_UP + moves):
        for side in random.sample(sides, len(sides)):
            timed = side.move()
            if number >= WARM_UP:
                for span in SPANS:
                    side.times[span].append(timed[span])


def summary(app: Side, bare: Side) -> dict[str, Any]:
    """Return quantiles in milliseconds and their ratios, app to bare app, by span."""
    result: dict[str, Any] = {}
    for span in SPANS:
        quantiles = {
            name: dict(zip(("p50", "p95"), np.percentile(side.times[span], (50, 95)), strict=True))
            for name, side in (("app", app), ("bare", bare))
        }
        ratio = {q: quantiles["app"][q] / quantiles["bare"][q] for q in ("p50", "p95")}
        result[span] = {**quantiles, "ratio": ratio}
    return result


def print_table(result: dict[str, Any]) -> None:
    """Print milliseconds of both apps and their ratio."""
    print(f"{'':18}{'app, ms':>16}{'bare app, ms':>16}{'app / bare':>16}")
    print(f"{'':18}" + f"{'p50':>8}{'p95':>8}" * 3)
    for span, title in SPANS.items():
        row = [result[span][who][q] for who in ("app", "bare") for q in ("p50", "p95")]
        ratios = [result[span]["ratio"][q] for q in ("p50", "p95")]
        numbers = "".join(f"{each:8.1f}" for each in row) + "".join(f"{r:8.2f}" for r in ratios)
        print(f"{title:18}{numbers}")


def main() -> None:
    """Measure, print the table, and write JSON if requested."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--app", default=shlex.join(APP), help="command of the app; {port} stands for its port"
    )
    parser.add_argument(
        "--watch", nargs="+", default=["/arm", "/ghost"], help="nodes of the app whose poses count"
    )
    parser.add_argument("--axis", choices="xyz", default="x", help="arrow of the gizmo to drag")
    parser.add_argument("--moves", type=int, default=60, help="measured moves of each app")
    parser.add_argument("--json", type=Path, help="file for the figures and every single time")
    options = parser.parse_args()

    with ExitStack() as stack:
        browser = stack.enter_context(launched())
        app, bare = (
            open_side(stack, browser, command, prefixes, options.axis)
            for command, prefixes in (
                (shlex.split(options.app), options.watch),
                (BARE_APP, ["/arm"]),
            )
        )
        measure((app, bare), options.moves)
        name = browser.version
    result = summary(app, bare)
    print(f"{options.moves} moves each by turns, Chromium {name}, draw calls left out")
    print_table(result)
    if options.json:
        record = {
            "browser": name,
            "command": options.app,
            "moves": options.moves,
            "milliseconds": result,
            "times": {"app": app.times, "bare": bare.times},
        }
        options.json.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
