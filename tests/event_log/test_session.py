"""Test that a session of several people and programs is in the log, each action once, in order."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from katana450.arm.control.lease import Role
from katana450.assembly.event_log.record_maker import Record
from katana450.cli.main import main
from katana450.client import aconnect
from katana450.client.client import AsyncClient
from katana450.server.api import answers
from katana450.server.api.program_requests import Program, ProgramOrder, Steer
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, AppServer
from tests.event_log.logs import records
from tests.gateway.client import HOUR, UPRIGHT, Control, Peer, ask, healthy, opened
from tests.gateway.lines import Lines

KEY = "k" * 32
PAUSE = 1.3
"""[s] A stream ends after a second without a command."""

SCRIPT = "name: Wave\nsteps:\n  - joints: [5, -68, 85, 8, 0]\n"


def links(path: Path) -> dict[str, str]:
    file = AccessFile.create(path)
    roles = {"Vera": Role.VIEWER, "Otto": Role.OPERATOR, "Ada": Role.ADMIN}
    return {name: file.give(name, role, time.time() + HOUR) for name, role in roles.items()}


async def drag(peer: Peer, *path: float) -> None:
    """Drag the tool's handle along ``path``, its y coordinates [m]."""
    name = "/target/move"
    await peer.say(type="TransformControlsDragStartMessage", name=name, owner="")
    for y in path:
        await peer.say(
            type="TransformControlsUpdateMessage",
            name=name,
            owner="",
            wxyz=UPRIGHT,
            position=[0.45, y, 0.4],
        )
        await asyncio.sleep(0.05)
    await peer.say(type="TransformControlsDragEndMessage", name=name, owner="")
    await asyncio.sleep(PAUSE)


async def until(arm: AsyncClient, status: str) -> None:
    """Wait until the program has ``status``."""
    async with asyncio.timeout(20.0):
        while True:
            program = (await arm.query(answers.State)).program
            if program is not None and program.status == status:
                return
            await asyncio.sleep(0.02)


def post(server: AppServer, token: str, **request: Any) -> int:
    status, _, _ = ask(
        f"{server.url}/api/v1/do",
        data=json.dumps(request).encode(),
        Authorization=f"Bearer {token}",
        X_Program=KEY,
        X_Name="Poster",
    )
    return status


async def act(server: AppServer, tokens: dict[str, str], numbers: dict[str, str]) -> None:
    """Play the session."""
    async with (
        opened(server.url, tokens["Otto"]) as (peer, otto),
        opened(server.url, tokens["Vera"]) as (_, vera),
        opened(server.url, tokens["Ada"]) as (_, ada),
    ):
        await otto.say("acquire")
        await otto.wait(mine=True)
        await drag(peer, 0.0, 0.02, 0.04)
        await otto.say("joint", axis=1, value=0.1)
        # Two connections have no order, so each speaks after the answer to the other.
        await otto.say("query")
        await otto.notice("state")
        await refused(vera, "home")
        await vera.say("stop")
        await otto.wait(stop="confirmed")
        await refused(vera, "clear_stop")
        await otto.clear_stop()
        url, bearer = f"{server.stop_url}/api/v1/stop", f"Bearer {tokens['Vera']}"
        pressed = asyncio.to_thread(ask, url, data=b"", Authorization=bearer, X_Name="Phone")
        assert (await pressed)[0] == 200
        await otto.wait(stop="confirmed")
        await otto.clear_stop()
        await ada.say("take")
        await ada.wait(mine=True)
        await ada.say("release_lease")
        await otto.wait(holder=None)
        async with aconnect(server.url, "Script", tokens["Otto"]) as script:
            await script.ask(Program(text=SCRIPT))
            await until(script, "ready")
            await script.ask(Steer(order=ProgramOrder.RUN))
            await until(script, "done")
        lines = Lines(server)
        with lines.socket, lines.reader:
            lines.say(do="hello", name="Liner", token=tokens["Otto"])
            assert lines.hear()["is"] == "welcome"
            assert lines.answer(do="nudge", axis=2, by=0.01)["is"] == "done"
            assert lines.answer(do="release_lease")["is"] == "done"
        assert post(server, tokens["Otto"], do="nudge", axis=3, by=0.01) == 200
        assert post(server, tokens["Otto"], do="release_lease") == 200
        assert main(["access", "revoke", numbers["Vera"], "--file", numbers["file"]]) == 0
        async with asyncio.timeout(5.0):
            await vera.socket.wait_closed()
        await asyncio.sleep(PAUSE)
        os.kill(server.front, signal.SIGKILL)
    await asyncio.sleep(0.5)
    end = time.monotonic() + 60.0
    while not healthy(server):
        assert time.monotonic() < end
        await asyncio.sleep(0.1)
    assert post(server, tokens["Otto"], do="home") == 409


async def refused(control: Control, do: str) -> None:
    await control.say(do)
    await control.notice("refused")


def story(log: list[Record]) -> list[str]:
    """Return the records in short: who, channel, kind, content, grounds and outcome."""
    short = []
    for entry in log:
        who, what = entry.get("who", {}), entry.get("what", {})
        content = " ".join(
            str(what[key])
            for key in ("command", "request", "count", "axis", "by", "value", "lease", "to", "stop")
            if key in what
        )
        content += " ".join(str(what[key]) for key in ("order", "program", "ended") if key in what)
        parts = (entry["kind"], who.get("name"), who.get("channel"), content)
        rest = (entry.get("grounds"), entry.get("outcome"))
        short.append(" | ".join(str(part or "-") for part in (*parts, *rest)))
    return short


STORY = """\
start | the server | server | - | - | -
sign-in | Somebody | HTTP | - | - | refused
sign-in | Otto | page | - | - | accepted
sign-in | Vera | page | - | - | accepted
sign-in | Ada | page | - | - | accepted
lease | Otto | page | acquired Otto | the lease was free | -
command | Otto | scene | Position | holds the lease | accepted
command | Otto | scene | EndDrag | holds the lease | accepted
command | Otto | page | Joint 1 0.1 | holds the lease | accepted
refusal | Vera | page | Home | - | refused
stop | Vera | page | pressed | anybody may stop the arm | accepted
refusal | Vera | page | ClearStop | - | refused
clear | Otto | page | ClearStop | holds the lease | accepted
stop | Vera, Phone | HTTP | pressed | anybody may stop the arm | accepted
clear | Otto | page | ClearStop | holds the lease | accepted
lease | Ada | page | taken Ada | an admin may take the lease | -
lease | Ada | page | released | holds the lease | -
lease | Wave | program | acquired Wave | the lease was free | -
command | Wave | program | Hold | holds the lease | accepted
program | Otto, Script | websocket | run Wave | - | -
command | Wave | program | Speed 1.0 | holds the lease | accepted
command | Wave | program | Follow | holds the lease | accepted
command | the server | server | Speed 1.0 | protection by the server | accepted
lease | Wave | program | released | holds the lease | -
program | Wave | program | done | - | -
lease | Otto, Liner | TCP | acquired Otto, Liner | the lease was free | -
command | Otto, Liner | TCP | Nudge 2 0.01 | took the free lease | accepted
lease | Otto, Liner | TCP | released | holds the lease | -
lease | Otto, Poster | HTTP | acquired Otto, Poster | the lease was free | -
command | Otto, Poster | HTTP | Nudge 3 0.01 | took the free lease | accepted
lease | Otto, Poster | HTTP | released | holds the lease | -
revocation | Vera | page | - | - | -
start | the server | server | - | - | -
stop | the server | server | protection | protection by the server | accepted
refusal | Otto, Poster | HTTP | Home | - | refused
end | the server | server | - | - | -
""".splitlines()
"""Everything that was done."""

UNORDERED = ("join", "leave", "finding")
"""Kinds that have their own times, among the others."""


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str], str]:
    """Play the session once; return the folder of the log, the links and the output."""
    folder = tmp_path_factory.mktemp("session")
    tokens = links(folder / "access.json")
    numbers = {
        grant.name: number
        for number, grant in AccessFile.open(folder / "access.json").grants.items()
    }
    numbers["file"] = str(folder / "access.json")
    options = ("--lines", "0", "--access", numbers["file"], "--log", str(folder / "log"))
    with AppServer((*APP, *options)) as server:
        ask(f"{server.url}/enter", data=b'{"token": "guess"}', Origin=server.url)
        asyncio.run(act(server, tokens, numbers))
    return folder / "log", tokens, server.output


def test_every_action_is_recorded_once_and_in_order(
    session: tuple[Path, dict[str, str], str],
) -> None:
    log = [entry for entry in records(session[0]) if entry["kind"] not in UNORDERED]
    assert story(log) == STORY


def test_arrivals_and_departures_are_recorded(session: tuple[Path, dict[str, str], str]) -> None:
    log = [entry for entry in records(session[0]) if entry["kind"] in ("join", "leave")]
    joined = [entry["who"]["name"] for entry in log if entry["kind"] == "join"]
    left = {entry["who"]["name"] for entry in log if entry["kind"] == "leave"}
    programs = ["Otto, Script", "Otto, Liner", "Otto, Poster"]
    assert joined == ["Otto", "Vera", "Ada", *programs, "Otto, Poster"]
    # The front end was killed before the others left.
    assert {"Vera", "Otto, Script", "Otto, Liner"} <= left


def test_values_and_findings_are_recorded(session: tuple[Path, dict[str, str], str]) -> None:
    log = records(session[0])
    (drag,) = (entry for entry in log if entry.get("what", {}).get("command") == "Position")
    assert drag["what"]["p"][0] == pytest.approx(0.45)
    (follow,) = (entry for entry in log if entry.get("what", {}).get("command") == "Follow")
    assert 0.1 < follow["what"]["plan"]["seconds"] < 5.0
    stops = [entry for entry in log if entry.get("what", {}).get("reason") == "stopped"]
    assert [stop["what"]["began"] for stop in stops[:2]] == [True, False]
    first, second = (entry["what"] for entry in log if entry["kind"] == "start")
    assert (first["port"], first["pid"] == second["pid"]) == (second["port"], False)


def test_participants_are_named_by_role_link_and_address(
    session: tuple[Path, dict[str, str], str],
) -> None:
    path = session[0].parent / "access.json"
    (number,) = (
        number for number, grant in AccessFile.open(path).grants.items() if grant.name == "Otto"
    )
    for entry in records(session[0]):
        who = entry.get("who", {})
        if who.get("name", "").startswith("Otto"):
            assert (who["role"], who["link"], who["address"]) == ("operator", number, "127.0.0.1")
    # The presser on the port of STOP too.
    stops = [entry["who"] for entry in records(session[0]) if entry["kind"] == "stop"]
    assert [(who.get("role"), who["channel"]) for who in stops] == [
        ("viewer", "page"),
        ("viewer", "HTTP"),
        (None, "server"),
    ]
    assert stops[0]["link"] == stops[1]["link"]


def test_no_secret_is_in_the_log(session: tuple[Path, dict[str, str], str]) -> None:
    folder, tokens, output = session
    content = b"".join(path.read_bytes() for path in folder.iterdir()).decode()
    secrets = [*tokens.values(), KEY, "guess", "katana450-"]
    assert [secret for secret in secrets if secret in content or secret in output] == []
