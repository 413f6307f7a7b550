"""Without ``--record`` a server records in the folder of the system for states of programs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from katana450.extensions.recording.folders import default_folder


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
    folder, episodes = default_folder(8080), default_folder(8080, "episodes")
    monkeypatch.undo()
    assert folder == tmp_path / expected / "katana450" / "recordings" / "port-8080"
    assert episodes == tmp_path / expected / "katana450" / "episodes" / "port-8080"
