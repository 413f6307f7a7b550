"""The address of this server for a phone."""

from __future__ import annotations

import shlex
from pathlib import Path
from urllib.parse import unquote_to_bytes

import pytest

from katana450.cli.main import _parser, main
from katana450.extensions import phone
from katana450.extensions.phone import LINK_REQUIRED, LOOPBACK_ONLY, phone_address
from katana450.server.web.authenticator import LOOPBACK_NAMES, Address

LOOPBACK = Address(LOOPBACK_NAMES, any_address=False, secure=False)
OPEN = Address(LOOPBACK_NAMES | {"robot"}, any_address=True, secure=False)


@pytest.fixture(autouse=True)
def in_a_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phone, "own_address", lambda: "192.168.1.5")


@pytest.mark.parametrize(
    ("address", "host", "url"),
    [
        (OPEN, "robot:8080", "http://robot:8080"),
        (OPEN, "10.0.0.7:8080", "http://10.0.0.7:8080"),
        # The name of this machine for itself is no address for a phone.
        (OPEN, "127.0.0.1:8080", "http://192.168.1.5:8080"),
        (OPEN, "localhost:9000", "http://192.168.1.5:8080"),
        (OPEN, "[::1]:8080", "http://192.168.1.5:8080"),
        (
            Address(LOOPBACK_NAMES, any_address=True, secure=True),
            "127.0.0.1:8080",
            "https://192.168.1.5:8080",
        ),
        (
            Address(LOOPBACK_NAMES, any_address=False, secure=False, public="https://arm.example"),
            "127.0.0.1:8080",
            "https://arm.example",
        ),
    ],
)
def test_address_is_one_that_a_phone_can_open(address: Address, host: str, url: str) -> None:
    offer = phone_address(address, host, 8080, requires_link=True)
    assert offer.url == url
    assert LINK_REQUIRED in offer.note
    assert ("Without https" in offer.note) == url.startswith("http:")
    assert offer.code is not None
    assert unquote_to_bytes(offer.code.partition(",")[2]).startswith(b"<svg ")


def test_server_on_loopback_says_how_to_let_a_phone_in(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    offer = phone_address(LOOPBACK, "localhost:8080", 8080, requires_link=False)
    assert (offer.url, offer.code, offer.note) == (None, None, LOOPBACK_ONLY)
    assert offer.command is not None
    give, serve = (shlex.split(part) for part in offer.command.split("&&"))
    assert give[:3] == ["katana450", "access", "give"]
    assert give[-1] == "http://192.168.1.5:8080"
    # Both commands have these options.
    access = str(tmp_path / "access.json")
    assert main([access if part == "access.json" else part for part in give[1:]]) == 0
    assert "http://192.168.1.5:8080/#" in capsys.readouterr().out
    options = _parser(serve[1:]).parse_args(serve[1:])
    assert (options.host, options.port, str(options.access)) == ("0.0.0.0", 8080, "access.json")
    monkeypatch.setattr(phone, "own_address", lambda: None)
    assert phone_address(OPEN, "localhost:8080", 8080, requires_link=False).url is None
