"""Test access to a running server: links, roles, revocation, commands and settings."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
import ssl
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from katana450.arm.control.lease import Role
from katana450.cli.main import main
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, ROOT, AppServer, free_port
from tests.gateway.client import HOUR, ask, controlling, enter, opened


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[AppServer, Path]]:
    """Start a server that requires links; yield it and the access file."""
    path = tmp_path_factory.mktemp("access") / "access.json"
    AccessFile.create(path)
    with AppServer((*APP, "--access", str(path))) as server:
        yield server, path


def give(path: Path, role: Role, seconds: float = HOUR) -> str:
    return AccessFile.open(path).give(role.value.title(), role, time.time() + seconds)


async def newest_line(url: str, cookie: str) -> Any:
    """Return the newest line of the event log once there is one; it follows the state."""
    async with asyncio.timeout(10.0):
        while True:
            status, _, body = ask(f"{url}/api/v1/event_log", Cookie=cookie)
            assert status == 200
            if lines := json.loads(body)["lines"]:
                return lines[-1]
            await asyncio.sleep(0.02)


def test_visitor_without_a_link_gets_the_explaining_page(guarded: tuple[AppServer, Path]) -> None:
    server, _ = guarded
    assert ask(server.url)[0] == 200
    assert ask(f"{server.url}/health")[2] == b"ok\n"
    for token in ("", "guess"):
        body = json.dumps({"token": token}).encode()
        status, headers, _ = ask(f"{server.url}/enter", data=body, Origin=server.url)
        assert status == 401
        assert "set-cookie" not in headers
    for path in ("/api/v1/state", "/api/v1/event_log", "/api/v1/phone"):
        assert ask(server.url + path, Cookie=f"katana450-{server.port}={'a' * 22}")[0] == 401


def test_guessing_access_links_is_rate_limited_per_client(guarded: tuple[AppServer, Path]) -> None:
    server, path = guarded

    def guess() -> int:
        body = json.dumps({"token": "guess"}).encode()
        return ask(f"{server.url}/enter", data=body, Origin=server.url)[0]

    assert 429 in [guess() for _ in range(40)]
    assert enter(server.url, give(path, Role.VIEWER))


def test_roles_grant_exactly_their_rights(guarded: tuple[AppServer, Path]) -> None:
    server, path = guarded

    async def act() -> None:
        viewer, operator, admin = (give(path, role) for role in Role)
        async with (
            opened(server.url, viewer) as (watching, watcher),
            opened(server.url, operator) as (driving, driver),
            opened(server.url, admin) as (_, boss),
        ):
            for request in ("acquire", "take", "ask"):
                await watcher.say(request)
                assert "only watch" in (await watcher.notice("refused"))["why"]
            await watching.set("1 base turn", value=20.0)
            assert "only watch" in (await watcher.notice("refused"))["why"]
            await driving.set("1 base turn", value=10.0)
            assert (await watcher.wait(holder="Operator"))["role"] == "viewer"
            async with asyncio.timeout(5.0):
                while not any(
                    message["type"] == "SetOrientationMessage"
                    for message in await watching.listen()
                ):
                    pass
            await boss.say("take")
            await watcher.wait(holder="Admin")
            await driver.say("take")
            assert "Only an admin" in (await driver.notice("refused"))["why"]
            await driver.say("ask")
            (asking,) = (await boss.wait(asking=[{"number": 2, "name": "Operator"}]))["asking"]
            await boss.say("give", to=asking["number"])
            await watcher.wait(holder="Operator")
            await watcher.say("stop")
            assert "Viewer pressed STOP" in (await driver.wait(mood="stopped"))["stopped"]
            last = await newest_line(server.url, enter(server.url, viewer))
            assert (last["finding"]["reason"], last["who"]) == ("stopped", "Viewer")
            await watcher.say("clear_stop")
            await watcher.notice("refused")
            await driver.clear_stop()
            await watcher.wait(stopped=None)

    asyncio.run(act())


def test_revoked_identity_is_disconnected(guarded: tuple[AppServer, Path]) -> None:
    server, path = guarded

    async def stay(token: str, end: object) -> None:
        cookie = enter(server.url, token)
        async with controlling(server.url, cookie) as control:
            await control.wait(mood="ok", seconds=10.0)
            assert end is None or main(["access", "revoke", str(end), "--file", str(path)]) == 0
            async with asyncio.timeout(20.0):
                with suppress(ConnectionClosed):
                    await control.socket.wait_closed()
            assert control.socket.close_code == 4401

    asyncio.run(stay(give(path, Role.ADMIN, 4.0), None))
    token = give(path, Role.ADMIN)
    known = AccessFile.open(path).check(token, time.time())
    assert known is not None
    asyncio.run(stay(token, known[0]))


def test_no_link_is_in_the_log(guarded: tuple[AppServer, Path]) -> None:
    server, path = guarded
    token = give(path, Role.VIEWER)
    enter(server.url, token)
    ask(f"{server.url}/?{token}")
    assert token not in server.output
    assert json.loads(path.read_text())["secret"] not in server.output


def test_access_commands_give_list_and_revoke(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "access.json"
    options = ["--file", str(path)]
    give_anna = ["access", "give", "--name", "Anna", "--for", "7d", "--url", "https://arm.example"]
    assert main([*give_anna, *options]) == 0
    origin, _, token = capsys.readouterr().out.strip().partition("/#")
    assert origin == "https://arm.example"
    known = AccessFile.open(path).check(token, time.time() + 6 * 24 * HOUR)
    assert known is not None
    assert main(["access", "list", *options]) == 0
    listed = capsys.readouterr().out
    assert known[0] in listed
    assert "Anna" in listed
    assert token not in listed
    assert main(["access", "revoke", known[0], *options]) == 0
    assert AccessFile.open(path).check(token, time.time()) is None
    assert main(["access", "revoke", known[0], *options]) == 1
    with pytest.raises(SystemExit):
        main([*give_anna[:4], "--for", "forever", *options])


def test_public_server_needs_links_or_an_explicit_option() -> None:
    command = [sys.executable, "-m", "katana450", "serve", "--host", "0.0.0.0"]
    done = subprocess.run(
        [*command, "--port", str(free_port())],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1
    assert "--access" in done.stderr
    assert "--insecure" in done.stderr
    assert "Traceback" not in done.stderr
    with AppServer((*command, "--port", "{port}", "--insecure")) as server:
        assert enter(server.url)
        check_health(server.pid, f"{server.url} is well.")


def check_health(process: int, said: str, status: int = 0) -> None:
    """Run the health check of the container image, which has ``process`` for its first one."""
    image = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    printed = re.search(r"^HEALTHCHECK .*\\\n +CMD (\[.*\])$", image, re.MULTILINE)
    assert printed is not None
    _, script = json.loads(printed[1])
    command = [sys.executable, str(ROOT / Path(script).name), str(process)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, (done.stdout + done.stderr).startswith(said)) == (status, True), done


def test_container_is_not_well_without_an_answer() -> None:
    port = free_port()
    command = [sys.executable, "-c", "input()", "serve", f"--port={port}"]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        check_health(process.pid, f"http://127.0.0.1:{port} is not well: ", 1)
        process.communicate(b"\n")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificate")
def test_server_uses_https(tmp_path: Path) -> None:
    cert, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    options = ("-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost")
    names = ("-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1")
    files = ("-keyout", str(key), "-out", str(cert))
    subprocess.run(
        ["openssl", "req", "-x509", *options, *names, *files], check=True, capture_output=True
    )
    with AppServer(
        (*APP, "--tls-cert", str(cert), "--tls-key", str(key)), scheme="https"
    ) as server:
        request = urllib.request.Request(
            f"{server.url}/enter", data=b'{"token": ""}', headers={"Origin": server.url}
        )
        trusting = ssl.create_default_context(cafile=str(cert))
        with urllib.request.urlopen(request, context=trusting, timeout=10) as answer:
            assert "Secure" in answer.headers["set-cookie"]
            assert "Strict-Transport-Security" in answer.headers
        # So does the port of STOP.
        stop = urllib.request.Request(f"{server.stop_url}/api/v1/stop", data=b"")
        with urllib.request.urlopen(stop, context=trusting, timeout=10) as answer:
            assert answer.read().startswith(b'{"stop": "confirmed"')
        with urllib.request.urlopen(f"{server.url}/health", context=trusting) as answer:
            assert answer.read() == b"ok\n"
        check_health(server.pid, f"{server.url} is well.")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--tls-cert", "/nowhere"), "both --tls-cert and --tls-key"),
        (("--tls-cert", "/nowhere", "--tls-key", "/nowhere"), "are not a certificate and its key"),
        (("--access", "/nowhere"), "access give"),
        (("--public-url", "arm"), "looks like"),
    ],
)
def test_invalid_setting_is_reported(
    options: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", "--port", str(free_port()), *options]) == 1
    assert message in capsys.readouterr().err
