"""Test access to a running server: links, roles, revocation, commands and settings."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import shutil
import ssl
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from katana450.arm.control.lease import Role
from katana450.cli.main import main
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, ROOT, AppServer, free_port
from tests.gateway.client import HOUR
from tests.gateway.virtual import VirtualServer


def give(file: AccessFile, role: Role, seconds: float = HOUR) -> str:
    return file.give(role.value.title(), role, time.time() + seconds)


def test_visitor_without_a_link_gets_the_explaining_page(guarded: VirtualServer) -> None:
    assert guarded.ask("/")[0] == 200
    assert guarded.ask("/health")[2] == b"ok\n"
    for token in ("", "guess"):
        body = json.dumps({"token": token}).encode()
        status, headers, _ = guarded.ask("/enter", data=body, Origin=guarded.url)
        assert status == 401
        assert "set-cookie" not in headers
    for path in ("/api/v1/state", "/api/v1/objects", "/api/v1/phone"):
        assert guarded.ask(path, Cookie=f"katana450-9={'a' * 22}")[0] == 401


def test_guessing_access_links_is_rate_limited(guarded: VirtualServer, file: AccessFile) -> None:
    def guess() -> int:
        body = json.dumps({"token": "guess"}).encode()
        return guarded.ask("/enter", data=body, Origin=guarded.url)[0]

    assert 429 in [guess() for _ in range(40)]
    # A valid link is accepted even while others guess.
    assert guarded.run(guarded.enter(give(file, Role.VIEWER)))


def test_roles_grant_exactly_their_rights(guarded: VirtualServer, file: AccessFile) -> None:
    async def act() -> None:
        cookies = [await guarded.enter(give(file, role)) for role in Role]
        watcher, driver, boss = [await guarded.control(cookie) for cookie in cookies]
        acts: list[tuple[str, dict[str, Any]]] = [
            *((act, {}) for act in ("acquire", "take", "ask", "home")),
            ("speed", {"value": 1.0}),
            ("jog", {"rates": [0.1, 0.0, 0.0, 0.0, 0.0]}),
        ]
        for act, fields in acts:
            await watcher.say(act, **fields)
            assert "only watch" in (await watcher.notice("refused"))["why"]
        await driver.say("joint", axis=1, value=0.2)
        assert (await watcher.wait(holder="Operator"))["role"] == "viewer"
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
        # Rest, and the time in which a stop cannot be cleared, are over.
        await driver.wait(wait="")
        await watcher.say("clear_stop")
        assert "only watch" in (await watcher.notice("refused"))["why"]
        assert watcher.status["stopped"] is not None
        await driver.clear_stop()
        await watcher.wait(stopped=None)

    guarded.run(act())


def test_identity_whose_link_ends_is_disconnected(
    guarded: VirtualServer, file: AccessFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    now, offsets = time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: now() + offsets[0])

    async def stay(token: str, end: Callable[[], object]) -> None:
        control = await guarded.control(await guarded.enter(token))
        await control.wait(mood="ok")
        end()
        async with asyncio.timeout(2.0):
            await control.socket.wait_closed()
        assert control.socket.close_code == 4401

    token = give(file, Role.ADMIN)
    known = file.check(token, time.time())
    assert known is not None
    command = ["access", "revoke", known[0], "--file", str(file.path)]
    guarded.run(stay(token, lambda: main(command)))
    guarded.run(stay(give(file, Role.ADMIN), lambda: offsets.insert(0, 2.0 * HOUR)))


def test_no_link_is_in_the_log(
    guarded: VirtualServer, file: AccessFile, caplog: pytest.LogCaptureFixture
) -> None:
    token = give(file, Role.VIEWER)
    guarded.run(guarded.enter(token))
    guarded.ask(f"/?{token}")
    assert token not in caplog.text
    assert json.loads(file.path.read_text())["secret"] not in caplog.text


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
        (("--host", "0.0.0.0"), "--insecure"),
        (("--host", "0.0.0.0"), "--access access.json"),
    ],
)
def test_invalid_setting_is_reported(
    options: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", "--port", str(free_port()), *options]) == 1
    assert message in capsys.readouterr().err


YEARS = 4e9
"""[s since the epoch]"""


def removed(path: Path) -> None:
    path.unlink()


def open_to_others(path: Path) -> None:
    path.chmod(0o644)
    path.touch()


def cut_off(path: Path) -> None:
    path.write_text("{")


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir(mode=0o700)


@pytest.mark.parametrize("fault", [removed, open_to_others, cut_off, a_folder])
def test_last_readable_links_stay_valid_and_the_error_is_logged_once(
    file: AccessFile, caplog: pytest.LogCaptureFixture, fault: Callable[[Path], None]
) -> None:
    token = file.give("Anna", Role.OPERATOR, YEARS)
    served = AccessFile.open(file.path)
    fault(file.path)
    with caplog.at_level(logging.ERROR):
        for _ in range(3):
            grant = served.check(token, 0.0)
            assert grant is not None
            assert grant[1].name == "Anna"
        assert served.check("guess", 0.0) is None
    assert len(caplog.records) == 1


def test_links_are_read_again_once_the_file_is_repaired(file: AccessFile) -> None:
    token = file.give("Anna", Role.OPERATOR, YEARS)
    served = AccessFile.open(file.path)
    open_to_others(file.path)
    assert served.check(token, 0.0) is not None
    file.path.chmod(0o600)
    (number,) = file.grants
    file.revoke(number)
    assert served.check(token, 0.0) is None


def test_stop_works_with_an_unreadable_access_file(
    guarded: VirtualServer, file: AccessFile, caplog: pytest.LogCaptureFixture
) -> None:
    token = file.give("Vera", Role.VIEWER, YEARS)
    cookie = guarded.run(guarded.enter(token))
    file.path.write_text("{")
    status, _, body = guarded.ask("/stop", data=b"", Cookie=cookie, Origin=guarded.url)
    assert (status, body) == (204, b"")
    bearer = f"Bearer {token}"
    assert guarded.ask("/api/v1/stop", data=b"", Authorization=bearer)[0] == 204
    state = json.loads(guarded.ask("/api/v1/state", Authorization=bearer)[2])
    assert state["stopped"] == "Vera pressed STOP."
    assert guarded.ask("/stop", data=b"", Cookie="x=y", Origin=guarded.url)[0] == 401

    assert caplog.text.count("The last links that could be read stay valid") == 1
