"""Cost of the path through the gateway: the delay of each frame, and processor time.

    python -m benchmarks.gateway

A viser server turns seven links sixty times a second, in one atomic block like the app. Clients
receive everything, alternately from viser directly and through the gateway, and acknowledge it like
the page. A frame carries the time of its creation, on the same clock.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import statistics
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import msgspec
import numpy as np
import zstandard
from starlette.applications import Starlette
from websockets.asyncio.client import ClientConnection, connect

from benchmarks.start_and_idle import cpu_seconds
from katana450.assembly.routes import control_routes
from katana450.assembly.web_server import WebServer
from katana450.server.service.budget import Budgets
from katana450.server.service.hub import Hub
from katana450.server.viser_bridge.guard import Guard
from katana450.server.viser_bridge.proxy import SUBPROTOCOL, Proxy
from katana450.server.viser_bridge.viser_server import KEY_HEADER, open_server
from katana450.server.web.admission import Admission
from katana450.server.web.listen import listen
from katana450.settings import Settings
from tests.gateway.client import enter, page_name, websocket

KEY = "known to both halves of this benchmark"
RATE = 60.0
LINKS = 7
WARM_UP = 1.0


class _Stamp(msgspec.Struct):
    timestampSec: float  # noqa: N815  (viser's name)


def serve() -> None:
    """Run the server's half: print both ports and turn the links until killed."""
    server = open_server(KEY)
    frames = [server.scene.add_frame(f"/link{i}", show_axes=False) for i in range(LINKS)]
    listening = listen("127.0.0.1", 0)
    port = listening.getsockname()[1]
    web = WebServer(Settings(port=port), listening)
    web.start()
    hub = Hub(time.monotonic)
    proxy = Proxy(hub, web.authenticator, Guard(server), server.get_port(), KEY)
    routes = control_routes(hub, Budgets(hub.clock), web, proxy)
    app = Admission(Starlette(routes=[*web.routes, *routes]), hub, web.authenticator, web.acceptor)
    web.loop.call_soon_threadsafe(web.show, app)
    print(json.dumps({"viser": server.get_port(), "gateway": port}), flush=True)
    due = time.perf_counter()
    while True:
        angle = due % math.tau
        with server.atomic():
            for frame in frames:
                frame.wxyz = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        server.flush()
        due += 1.0 / RATE
        time.sleep(max(due - time.perf_counter(), 0.0))


@asynccontextmanager
async def client(ports: dict[str, int], route: str) -> AsyncIterator[ClientConnection]:
    """Connect to viser's stream, directly or through the gateway."""
    if route == "viser":
        direct = connect(
            f"ws://127.0.0.1:{ports['viser']}",
            subprotocols=[SUBPROTOCOL],
            additional_headers={KEY_HEADER: KEY},
            compression=None,
            max_size=None,
        )
        async with direct as socket:
            yield socket
        return
    url = f"http://127.0.0.1:{ports['gateway']}"
    path = f"/viser?page={page_name()}"
    async with websocket(url, path, enter(url), subprotocols=[SUBPROTOCOL]) as socket:
        yield socket


async def measure(ports: dict[str, int], route: str, size: int, seconds: float) -> list[float]:
    """Return the delays [s] of the frames at ``size`` clients."""
    delays: list[float] = []

    async def watch(socket: ClientConnection) -> None:
        unpack = zstandard.ZstdDecompressor()
        started, acknowledged, count = time.perf_counter(), 0.0, 0
        async for frame in socket:
            now = time.perf_counter()
            count += 1
            assert isinstance(frame, bytes)
            if route == "gateway" and now - acknowledged > 0.05:
                acknowledged = now
                await socket.send(msgspec.msgpack.encode({"type": "Seen", "count": count}))
            if now - started > WARM_UP:
                body = unpack.decompress(frame[16 : 16 + int.from_bytes(frame[8:16], "little")])
                delays.append(now - msgspec.msgpack.decode(body, type=_Stamp).timestampSec)
            if now - started > WARM_UP + seconds:
                return

    async with AsyncExitStack() as stack:
        sockets = [await stack.enter_async_context(client(ports, route)) for _ in range(size)]
        await asyncio.gather(*(watch(socket) for socket in sockets))
    return delays


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--clients", type=int, nargs="+", default=[1, 8])
    parser.add_argument("--seconds", type=float, default=6.0, help="of each turn (default: 6)")
    parser.add_argument("--turns", type=int, default=3, help="of each route (default: 3)")
    options = parser.parse_args()
    if options.serve:
        serve()
    command = [sys.executable, "-m", "benchmarks.gateway", "--serve"]
    root = Path(__file__).resolve().parents[1]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root) as server:
        assert server.stdout is not None
        ports = json.loads(server.stdout.readline())
        try:
            for size in options.clients:
                costs: dict[str, list[float]] = {"viser": [], "gateway": []}
                delays: dict[str, list[float]] = {"viser": [], "gateway": []}
                for _ in range(options.turns):
                    for route, cost in costs.items():
                        before, started = cpu_seconds([server.pid]), time.perf_counter()
                        delays[route] += asyncio.run(measure(ports, route, size, options.seconds))
                        took = time.perf_counter() - started
                        cost.append((cpu_seconds([server.pid]) - before) / took)
                for route, cost in costs.items():
                    p50, p95 = np.percentile(delays[route], (50, 95))
                    print(
                        f"{size:2} clients, {route:7}: {1e3 * p50:6.2f} ms p50, "
                        f"{1e3 * p95:6.2f} ms p95, {100 * statistics.median(cost):5.1f} % of a "
                        f"core, {len(delays[route])} frames"
                    )
        finally:
            server.kill()


if __name__ == "__main__":
    main()
