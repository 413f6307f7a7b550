"""Test access links, which are signed, expire and can be revoked, and the checks of origins."""

from __future__ import annotations

import asyncio
import json
import shutil
import ssl
import stat
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from itsdangerous import URLSafeSerializer
from starlette.responses import Response
from websockets.exceptions import ConnectionClosed

from katana450.arm.control.lease import Role
from katana450.cli.main import main
from katana450.errors import ConfigurationError, InputError
from katana450.server.web.access_links import SALT, AccessFile
from katana450.server.web.authenticator import Address, Authenticator, public_origin
from tests.browser.server import APP, ROOT, AppServer, free_port
from tests.gateway.client import ask, controlling, enter, opened

HOUR = 3600.0


@pytest.fixture
def file(tmp_path: Path) -> AccessFile:
    return AccessFile.create(tmp_path / "access.json")


def test_link_is_valid_for_its_person_until_it_expires(file: AccessFile) -> None:
    token = file.give("Anna", Role.OPERATOR, 1000.0)
    found = file.check(token, 999.0)
    assert found is not None
    assert (found[1].name, found[1].role) == ("Anna", Role.OPERATOR)
    assert file.check(token, 1000.0) is None


def test_revoked_link_is_invalid(file: AccessFile) -> None:
    tokens = [file.give(name, Role.VIEWER, HOUR) for name in ("Anna", "Bert")]
    known = file.check(tokens[0], 0.0)
    assert known is not None
    # Another process changes the file, as `katana450 access revoke` does.
    assert AccessFile.open(file.path).revoke(known[0]).name == "Anna"
    assert file.check(tokens[0], 0.0) is None
    assert file.check(tokens[1], 0.0) is not None
    with pytest.raises(InputError, match="no link"):
        file.revoke(known[0])


def test_access_link_needs_the_secret(file: AccessFile, tmp_path: Path) -> None:
    token = file.give("Anna", Role.VIEWER, HOUR)
    known = file.check(token, 0.0)
    assert known is not None
    payload, _, _ = token.rpartition(".")
    other = AccessFile.create(tmp_path / "other.json").give("Anna", Role.ADMIN, HOUR)
    later = URLSafeSerializer("guess", salt=SALT).dumps([known[0], 10 * HOUR])
    for forged in (
        "",
        ".",
        payload,
        token[:-1],
        token + "a",
        other,
        later,
        f"{payload}.",
        "x" * 999,
    ):
        assert file.check(forged, 0.0) is None
    # Tokens signed for another purpose, or with another content.
    secret = json.loads(file.path.read_text())["secret"]
    assert file.check(URLSafeSerializer(secret, salt="else").dumps([known[0], HOUR]), 0.0) is None
    strangers: list[Any] = [[known[0]], {}, None, [1, 2], [known[0], "soon"], [[], 5.0], "x"]
    for strange in strangers:
        assert file.check(URLSafeSerializer(secret, salt=SALT).dumps(strange), 0.0) is None


def test_file_readable_by_others_is_refused(file: AccessFile) -> None:
    file.give("Anna", Role.VIEWER, HOUR)
    assert stat.S_IMODE(file.path.stat().st_mode) == 0o600
    file.path.chmod(0o640)
    with pytest.raises(ConfigurationError, match="chmod 600"):
        AccessFile.open(file.path)


@pytest.mark.parametrize("content", ["", "{}", '{"secret": 1, "grants": {}}', "[]"])
def test_file_of_another_kind_is_reported(tmp_path: Path, content: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(content)
    path.chmod(0o600)
    with pytest.raises(ConfigurationError, match=r"other\.json is not an access file"):
        AccessFile.open(path)
    with pytest.raises(ConfigurationError, match="access give"):
        AccessFile.open(tmp_path / "nowhere.json")


@pytest.mark.parametrize("name", ["", "x" * 41, "two\nlines"])
def test_unprintable_or_too_long_name_is_refused(file: AccessFile, name: str) -> None:
    with pytest.raises(InputError, match="name"):
        file.give(name, Role.VIEWER, HOUR)


LOOPBACK = Address(frozenset({"localhost", "127.0.0.1"}), any_address=False, secure=False)
OPEN = Address(frozenset({"robot"}), any_address=True, secure=True)
PROXIED = Address(
    frozenset({"localhost"}), any_address=False, secure=False, public="https://arm.example.org"
)


@pytest.mark.parametrize(
    ("address", "host", "ours"),
    [
        (LOOPBACK, "127.0.0.1:8080", True),
        (LOOPBACK, "LOCALHOST:8080", True),
        (LOOPBACK, "192.168.0.5:8080", False),
        (LOOPBACK, "evil.example:8080", False),
        (OPEN, "192.168.0.5:8080", True),
        (OPEN, "[fe80::1]:8080", True),
        (OPEN, "robot", True),
        (OPEN, "robot.evil.example", False),
        (OPEN, "", False),
        (OPEN, "[", False),
        (PROXIED, "arm.example.org", True),
        (PROXIED, "arm.example.org:444", False),
        (PROXIED, "localhost:8080", True),
    ],
)
def test_only_own_host_names_are_accepted(address: Address, host: str, ours: bool) -> None:
    assert address.is_ours(host) is ours


@pytest.mark.parametrize(
    ("address", "origin", "host", "ours"),
    [
        (LOOPBACK, "http://127.0.0.1:8080", "127.0.0.1:8080", True),
        (LOOPBACK, "http://127.0.0.1:8081", "127.0.0.1:8080", False),
        (LOOPBACK, "https://127.0.0.1:8080", "127.0.0.1:8080", False),
        (LOOPBACK, "null", "127.0.0.1:8080", False),
        (OPEN, "https://robot", "robot", True),
        (PROXIED, "https://arm.example.org", "arm.example.org", True),
        (PROXIED, "http://arm.example.org", "other", False),
    ],
)
def test_only_own_origins_are_accepted(
    address: Address, origin: str, host: str, ours: bool
) -> None:
    assert address.is_our_page(origin, host) is ours


@pytest.mark.parametrize("url", ["arm.example.org", "ftp://arm", "https://", "https://a/b"])
def test_invalid_public_address_is_refused(url: str) -> None:
    with pytest.raises(ConfigurationError, match="looks like"):
        public_origin(url)


def test_cookies_are_sent_to_our_pages_alone(file: AccessFile) -> None:
    token = file.give("Anna", Role.VIEWER, time.time() + HOUR)
    for address, secure in ((LOOPBACK, False), (OPEN, True), (PROXIED, True)):
        authenticator = Authenticator(file, 8080, address)
        response = Response()
        assert authenticator.sign_in(token, response)
        cookie = response.headers["set-cookie"].lower()
        assert cookie.startswith(f"katana450-8080={token.lower()};")
        for part in ("httponly", "samesite=strict", "path=/", "max-age=3"):
            assert part in cookie
        assert ("secure" in cookie) is secure
        response = Response()
        assert not authenticator.sign_in("other", response)
        assert "set-cookie" not in response.headers


# With a real server


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[AppServer, Path]]:
    """Start a server that requires links; yield it and the access file."""
    path = tmp_path_factory.mktemp("access") / "access.json"
    AccessFile.create(path)
    with AppServer((*APP, "--access", str(path))) as server:
        yield server, path


def give(path: Path, role: Role, seconds: float = HOUR) -> str:
    return AccessFile.open(path).give(role.value.title(), role, time.time() + seconds)


def test_visitor_without_a_link_gets_the_explaining_page(guarded: tuple[AppServer, Path]) -> None:
    server, _ = guarded
    assert ask(server.url)[0] == 200
    assert ask(f"{server.url}/health")[2] == b"ok\n"
    for token in ("", "guess"):
        body = json.dumps({"token": token}).encode()
        status, headers, _ = ask(f"{server.url}/enter", data=body, Origin=server.url)
        assert status == 401
        assert "set-cookie" not in headers
    for path in ("/viser/", "/api/v1/state", "/api/v1/event_log"):
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
            await watching.set("Axis 1", value=20.0)
            assert "only watch" in (await watcher.notice("refused"))["why"]
            await driving.set("Axis 1", value=10.0)
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
            status, _, body = ask(
                f"{server.url}/api/v1/event_log", Cookie=enter(server.url, viewer)
            )
            last = json.loads(body)["lines"][-1]
            assert (status, last["finding"]["reason"], last["who"]) == (200, "stopped", "Viewer")
            await watcher.say("clear_stop")
            await watcher.notice("refused")
            await driver.say("clear_stop")
            await watcher.wait(stopped=None)

    asyncio.run(act())


def test_stop_press_over_two_channels_counts_once() -> None:
    async def act() -> None:
        with AppServer() as server:
            cookie = enter(server.url)

            def post(query: str = "") -> None:
                answer = ask(
                    f"{server.url}/stop{query}", data=b"", Cookie=cookie, Origin=server.url
                )
                assert answer[0] == 204

            async with controlling(server.url, cookie) as control:
                await control.wait(mood="ok")
                await control.say("stop", press="one")
                await control.wait(mood="stopped")
                await control.say("clear_stop")
                await control.wait(stopped=None)
                post("?press=one")
                await asyncio.sleep(0.3)
                assert control.status["stopped"] is None
                # A press with another name counts as a new one.
                for query in ("?press=two", "?press=" + 100 * "x", "?press=", ""):
                    post(query)
                    await control.wait(mood="stopped")
                    await control.say("clear_stop")
                    await control.wait(stopped=None)

    asyncio.run(act())


def test_revoked_identity_is_disconnected(guarded: tuple[AppServer, Path]) -> None:
    server, path = guarded

    async def stay(token: str, end: object) -> None:
        cookie = enter(server.url, token)
        async with controlling(server.url, cookie) as control:
            await control.wait(mood="ok", seconds=10.0)
            assert end is None or main(["access", "revoke", str(end), "--file", str(path)]) == 0
            async with asyncio.timeout(5.0):
                with suppress(ConnectionClosed):
                    await control.socket.wait_closed()
            assert control.socket.close_code == 4401

    asyncio.run(stay(give(path, Role.ADMIN, 1.5), None))
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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--tls-cert", "/nowhere"), "both --tls-cert and --tls-key"),
        (("--tls-cert", "/nowhere", "--tls-key", "/nowhere"), "not a certificate"),
        (("--access", "/nowhere"), "access give"),
        (("--public-url", "arm"), "looks like"),
    ],
)
def test_invalid_setting_is_reported(
    options: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", "--port", str(free_port()), *options]) == 1
    assert message in capsys.readouterr().err
