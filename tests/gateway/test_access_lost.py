"""Test an access file that becomes unreadable while the server runs: STOP keeps working."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path

import pytest

from katana450.arm.control.lease import Role
from katana450.assembly.robot_session import DescribedRobot
from katana450.server.web.access_links import AccessFile
from tests.gateway.virtual import VirtualServer

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


def test_stop_works_with_an_unreadable_access_file(
    described: DescribedRobot, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "access.json"
    access = AccessFile.create(path)
    token = access.give("Vera", Role.VIEWER, YEARS)
    with VirtualServer(described, access=access) as local:
        cookie = local.run(local.enter(token))
        path.write_text("{")
        status, _, body = local.ask("/stop", data=b"", Cookie=cookie, Origin=local.url)
        assert (status, body) == (204, b"")
        bearer = f"Bearer {token}"
        assert local.ask("/api/v1/stop", data=b"", Authorization=bearer)[0] == 204
        state = json.loads(local.ask("/api/v1/state", Authorization=bearer)[2])
        assert state["stopped"] == "Vera pressed STOP."
        assert local.ask("/stop", data=b"", Cookie="x=y", Origin=local.url)[0] == 401
    assert caplog.text.count("The last links that could be read stay valid") == 1
