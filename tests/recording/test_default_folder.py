"""Without ``--record`` a server records in the folder of the system for states of programs."""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

import pytest

import katana450
from katana450.extensions.recording.folders import (
    default_episodes_folder,
    default_folder,
    recordings_in,
)
from katana450.platform_support import cache_folder
from tests.browser.server import RECORDING_APP, AppServer
from tests.waiting import until


@pytest.mark.skipif(sys.platform != "linux", reason="XDG_STATE_HOME")
@pytest.mark.parametrize("named", [True, pytest.param(False, marks=pytest.mark.long)])
def test_server_records_where_its_start_says(tmp_path: Path, named: bool) -> None:
    environment = {
        **os.environ,
        "HOME": str(tmp_path),
        "XDG_CACHE_HOME": str(cache_folder()),
    }
    environment.pop("XDG_STATE_HOME", None)
    state = tmp_path / ".local" / "state"
    if named:
        state = tmp_path / "named"
        environment["XDG_STATE_HOME"] = str(state)
    with AppServer(RECORDING_APP, environment=environment) as server:
        folder = state / "katana450" / "recordings" / f"port-{server.port}"
        episodes = state / "katana450" / "episodes" / f"port-{server.port}"
        assert f"are kept in {folder}, episodes in {episodes}" in server.output
        with katana450.connect(server.url, name="Ada") as client:
            client.joints((0.2, -1.0, 1.4, 0.3, 0.0))
            client.joints((0.0, -1.0, 1.4, 0.3, 0.0))
            until(partial(recordings_in, folder))
    (path,) = recordings_in(folder)
    assert katana450.open(path).verify().ticks > 50
    assert folder.stat().st_mode & 0o077 == 0
    assert episodes.is_dir()


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {}, ".local/state"),
        ("linux", {"XDG_STATE_HOME": "{home}/state"}, "state"),
        # The standard demands that a relative path is ignored.
        ("linux", {"XDG_STATE_HOME": "state"}, ".local/state"),
        ("darwin", {"XDG_STATE_HOME": "{home}/state"}, "Library/Application Support"),
        ("win32", {}, "AppData/Local"),
        ("win32", {"LOCALAPPDATA": "{home}/local"}, "local"),
    ],
)
def test_default_folders_are_those_of_the_system(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    platform: str,
    variables: dict[str, str],
    expected: str,
) -> None:
    for name in ("XDG_STATE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value.format(home=tmp_path))
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setattr(sys, "platform", platform)
    folder, episodes = default_folder(8080), default_episodes_folder(8080)
    monkeypatch.undo()
    assert folder == tmp_path / expected / "katana450" / "recordings" / "port-8080"
    assert episodes == tmp_path / expected / "katana450" / "episodes" / "port-8080"
