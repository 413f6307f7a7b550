"""Test an access file that becomes unreadable while the server runs: STOP keeps working."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, AppServer
from tests.gateway.client import ask, enter

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
    tmp_path: Path, caplog: pytest.LogCaptureFixture, fault: Callable[[Path], None]
) -> None:
    file = AccessFile.create(tmp_path / "access.json")
    token = file.give("Anna", Role.OPERATOR, YEARS)
    served = AccessFile.open(file.path)
    fault(file.path)
    with caplog.at_level(logging.ERROR):
        for _ in range(3):
            found = served.check(token, 0.0)
            assert found is not None
            assert found[1].name == "Anna"
        assert served.check("guess", 0.0) is None
    assert len(caplog.records) == 1


def test_links_are_read_again_once_the_file_is_repaired(tmp_path: Path) -> None:
    file = AccessFile.create(tmp_path / "access.json")
    token = file.give("Anna", Role.OPERATOR, YEARS)
    served = AccessFile.open(file.path)
    open_to_others(file.path)
    assert served.check(token, 0.0) is not None
    file.path.chmod(0o600)
    (number,) = file.grants
    file.revoke(number)
    assert served.check(token, 0.0) is None


def test_stop_works_with_an_unreadable_access_file(tmp_path: Path) -> None:
    path = tmp_path / "access.json"
    token = AccessFile.create(path).give("Vera", Role.VIEWER, YEARS)
    with AppServer((*APP, "--access", str(path))) as server:
        cookie = enter(server.url, token)
        path.write_text("{")
        status, _, body = ask(f"{server.url}/stop", data=b"", Cookie=cookie, Origin=server.url)
        assert (status, body) == (204, b"")
        bearer = f"Bearer {token}"
        assert ask(f"{server.url}/api/v1/stop", data=b"", Authorization=bearer)[0] == 204
        state = json.loads(ask(f"{server.url}/api/v1/state", Authorization=bearer)[2])
        assert state["stopped"] == "Vera pressed STOP."
        assert ask(f"{server.url}/stop", data=b"", Cookie="x=y", Origin=server.url)[0] == 401
        due = time.monotonic() + 10.0
        while "stay valid" not in server.output and time.monotonic() < due:
            time.sleep(0.05)
        assert server.output.count("The last links that could be read stay valid") == 1
