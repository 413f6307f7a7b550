"""``katana450 serve`` opens its page where a person at this machine has started it."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from katana450.cli import serve
from katana450.cli.serve import show_page
from tests.browser.server import SIMULATION_APP, AppServer
from tests.waiting import until

URL = "http://127.0.0.1:8080"
BROWSER = """#!/bin/sh
echo "$1" > {page}
read line < {never}
"""
"""A browser that notes the address, and then runs until something is written to a pipe."""


class Now:
    """Takes the place of a thread; runs the work at once."""

    def __init__(self, target: Callable[[str], None], args: tuple[str], daemon: bool) -> None:
        assert daemon
        self._target, self._args = target, args

    def start(self) -> None:
        self._target(*self._args)


def system(platform: str, *, terminal: bool = True) -> SimpleNamespace:
    """Return what stands for the module ``sys``."""
    return SimpleNamespace(platform=platform, stdout=SimpleNamespace(isatty=lambda: terminal))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Pretend to be a person at a Linux with a screen; return the addresses that are opened."""
    for name in ("SSH_CONNECTION", "WSL_DISTRO_NAME", "WAYLAND_DISPLAY", "container", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(serve, "sys", system("linux"))
    monkeypatch.setattr(Path, "exists", lambda _: False)
    monkeypatch.setattr(threading, "Thread", Now)
    opened: list[str] = []

    def opens(url: str) -> bool:
        opened.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", opens)
    return opened


def test_page_is_opened_at_a_screen(
    opened: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    show_page(URL, 8080, 8081)
    monkeypatch.delenv("DISPLAY")
    monkeypatch.setattr(serve, "sys", system("darwin"))
    show_page(URL, 8080, 8081)
    assert opened == [URL, URL]
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("hindrance", ["no display", "SSH"])
def test_without_a_screen_one_sentence_says_how_to_open_it(
    hindrance: str,
    opened: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if hindrance == "SSH":
        monkeypatch.setenv("SSH_CONNECTION", "10.0.0.1 50000 10.0.0.2 22")
        # A browser for terminals would take the terminal of the server.
        monkeypatch.setenv("BROWSER", "w3m")
    else:
        monkeypatch.delenv("DISPLAY")
    show_page(URL, 8080, 8081)
    assert not opened
    (sentence,) = capsys.readouterr().out.splitlines()
    assert "`ssh -L 8080:127.0.0.1:8080 -L 8081:127.0.0.1:8081 HOST`" in sentence


@pytest.mark.parametrize("hindrance", ["no terminal", "container", "Docker"])
def test_no_page_is_opened_where_no_person_would_see_it(
    hindrance: str,
    opened: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if hindrance == "no terminal":
        monkeypatch.setattr(serve, "sys", system("linux", terminal=False))
    elif hindrance == "container":
        monkeypatch.setenv("container", "podman")
    else:
        monkeypatch.setattr(Path, "exists", lambda path: path == Path("/.dockerenv"))
    show_page(URL, 8080, 8081)
    assert not opened
    assert capsys.readouterr().out == ""
    # Unless its user has named a browser.
    monkeypatch.setenv("BROWSER", "my-browser")
    show_page(URL, 8080, 8081)
    assert opened == [URL]


@pytest.mark.usefixtures("opened")
def test_without_a_browser_the_address_is_to_be_opened_by_hand(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda _: False)
    show_page(URL, 8080, 8081)
    assert capsys.readouterr().out == f"No browser could be started. Open {URL} in one yourself.\n"


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="the browser is a shell script")
def test_start_does_not_wait_for_the_browser(tmp_path: Path) -> None:
    browser, page, never = (tmp_path / name for name in ("browser", "page", "never"))
    os.mkfifo(never)
    browser.write_text(BROWSER.format(page=page, never=never), encoding="utf-8")
    browser.chmod(0o755)
    command = [part for part in SIMULATION_APP if part != "--no-browser"]
    environment = {key: value for key, value in os.environ.items() if key != "SSH_CONNECTION"}
    with AppServer(command, environment=environment | {"BROWSER": str(browser)}) as server:
        until(lambda: page.exists() and page.read_text(encoding="utf-8"))
        assert page.read_text(encoding="utf-8") == f"{server.url}\n"
