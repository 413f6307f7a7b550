"""``katana450 go``: move the tool to a point on a running server, by a detour if necessary."""

from __future__ import annotations

import math
import time
from argparse import Namespace

from katana450.client import Client, connect
from katana450.maths.kinematics.projection import POSITION_WORTH_TELLING
from katana450.server.api import answers, requests

NAME = "Terminal"
"""Name of this client, which others see as the driver."""

OFFER_TIMEOUT = 5.0
"""[s] Timeout for the offer of a detour; a path around obstacles takes some seconds."""

POLL_INTERVAL = 0.05
"""[s] Interval at which the offer is checked."""


def go(options: Namespace) -> int:
    """Move the tool to ``options.place`` [mm] in {S}, print the result, return the exit status.

    The status is 1 if the tool point is not there afterwards. Raises RefusedError for a refused
    motion, and LostError without a server.
    """
    x, y, z = (1e-3 * value for value in options.place)
    with connect(options.url, NAME, options.token) as client:
        state = client.go(requests.Position(p=(x, y, z)))
        if state.status == "gap":
            print(state.why)
            state = _by_detour(client)
        print(state.why or "On target.")
    assert state.T is not None
    away = math.dist([row[3] for row in state.T[:3]], (x, y, z))
    return int(away > POSITION_WORTH_TELLING)


def _by_detour(client: Client) -> answers.State:
    """Take the detour from the gap, and return the state at its end; the present one without."""
    deadline = time.monotonic() + OFFER_TIMEOUT
    while (state := client.query(answers.State)).detour is None:
        if time.monotonic() > deadline:
            return state
        time.sleep(POLL_INTERVAL)
    print(f"Taking a {state.detour:.1f} s detour.", flush=True)
    return client.go(requests.Go())
