"""Test access links, which are signed, expire and can be revoked, and the checks of origins."""

from __future__ import annotations

import json
import stat
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from itsdangerous import URLSafeSerializer
from starlette.responses import Response

from katana450.arm.control.lease import Role
from katana450.atomic import write_files
from katana450.errors import ConfigurationError, InputError
from katana450.server.web import access_links
from katana450.server.web.access_links import SALT, AccessFile
from katana450.server.web.authenticator import Address, Authenticator, public_origin
from tests.gateway.client import HOUR


def test_link_is_valid_for_its_person_until_it_expires(file: AccessFile) -> None:
    token = file.give("Anna", Role.OPERATOR, 1000.0)
    grant = file.check(token, 999.0)
    assert grant is not None
    assert (grant[1].name, grant[1].role) == ("Anna", Role.OPERATOR)
    assert file.check(token, 1000.0) is None
    # The end that the token names counts too.
    number, secret = grant[0], json.loads(file.path.read_text())["secret"]
    for expires in (500.0, 2000.0):
        other = URLSafeSerializer(secret, salt=SALT).dumps([number, expires])
        assert file.check(other, min(expires, 1000.0) - 1.0) is not None
        assert file.check(other, min(expires, 1000.0)) is None


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


def test_link_that_is_revoked_during_another_change_stays_revoked(
    file: AccessFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    remaining, revoked = (number_of(file, name) for name in ("Anna", "Bert"))
    other = AccessFile.open(file.path)
    revoking = threading.Thread(target=other.revoke, args=(revoked,))

    def write(*args: Any, **more: Any) -> None:
        monkeypatch.setattr(access_links, "write_files", write_files)
        # Another process changes the file after this one has read it.
        revoking.start()
        revoking.join(0.3)
        write_files(*args, **more)

    monkeypatch.setattr(access_links, "write_files", write)
    added = number_of(file, "Cleo")
    revoking.join()
    assert set(file.grants) == {remaining, added}


def number_of(file: AccessFile, name: str) -> str:
    """Return the number of a new link."""
    grant = file.check(file.give(name, Role.VIEWER, time.time() + HOUR), time.time())
    assert grant is not None
    return grant[0]


def test_change_of_a_file_that_stays_locked_is_refused(
    file: AccessFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(access_links, "LOCK_TIMEOUT", 0.1)
    number = number_of(file, "Anna")
    with file._locked(), pytest.raises(InputError, match="locked"):
        AccessFile.open(file.path).revoke(number)
    AccessFile.open(file.path).revoke(number)
    assert file.grants == {}


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


def test_cookie_is_bound_to_its_link_and_is_no_link(file: AccessFile) -> None:
    token = file.give("Anna", Role.VIEWER, time.time() + HOUR)
    authenticator = Authenticator(file, 8080, LOOPBACK)
    cookies = []
    for _ in range(2):
        response = Response()
        assert authenticator.sign_in(token, response)
        name, _, rest = response.headers["set-cookie"].partition("=")
        cookies.append(rest.partition(";")[0])
    assert cookies[0] != cookies[1]
    identities = [authenticator.identity({name: cookie}) for cookie in cookies]
    assert identities[0] == identities[1] is not None
    # Neither serves as the other.
    assert authenticator.identity({name: token}) is None
    assert authenticator.program("", f"Bearer {cookies[0]}") is None
    assert not authenticator.sign_in(cookies[0], Response())
    # A server that starts again knows the cookie; revoking the link ends it.
    again = AccessFile.open(file.path)
    assert Authenticator(again, 8080, LOOPBACK).identity({name: cookies[0]}) == identities[0]
    (number,) = again.grants
    again.revoke(number)
    assert authenticator.identity({name: cookies[0]}) is None


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
        assert cookie.startswith("katana450-8080=")
        for part in ("httponly", "samesite=strict", "path=/", "max-age=3"):
            assert part in cookie
        assert ("secure" in cookie) is secure
        response = Response()
        assert not authenticator.sign_in("other", response)
        assert "set-cookie" not in response.headers


def test_file_of_an_earlier_version_with_more_fields_is_read(file: AccessFile) -> None:
    number = number_of(file, "Anna")
    content = json.loads(file.path.read_text())
    content["grants"][number] |= {"muted": 10.0, "kept_out": 20.0}
    file.path.write_text(json.dumps(content))
    assert AccessFile.open(file.path).grants[number].name == "Anna"
