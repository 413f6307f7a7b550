"""The connection of the page's server to the process that records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from multiprocessing.connection import Listener
from pathlib import Path
from typing import Any

import pytest

from katana450.arm.runtime.pipes.guarded_pipe import disconnect
from katana450.arm.runtime.pipes.private_listener import PrivateAddress
from katana450.errors import InputError
from katana450.extensions.recording.live import recorder_link
from katana450.extensions.recording.live.recorder_link import (
    ENTRY,
    RecorderLink,
    RecorderListener,
)
from katana450.extensions.recording.live.running_scripts import RunningScripts
from katana450.platform_support import pipe_address
from katana450.server.api.episode_requests import StartEpisode, StopEpisode
from tests.recording.episode_bench import ADA, Bench
from tests.waiting import until


class Page:
    """The part of a hub that is used."""

    def __init__(self) -> None:
        self.shown: dict[str, Any] = {}


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_link, "RECONNECT_SECONDS", 0.02)


@pytest.fixture
def address(tmp_path: Path) -> PrivateAddress:
    return PrivateAddress(pipe_address(tmp_path, "test"), b"a key")


def linked(page: Page, address: PrivateAddress) -> RecorderLink:
    return RecorderLink(page, address, 0.0)  # type: ignore[arg-type]


@pytest.fixture
def listen(bench: Bench, address: PrivateAddress) -> Iterator[Callable[..., RunningScripts]]:
    """Return a function that listens in this process, and returns the scripts that it hears of."""
    listeners: list[RecorderListener] = []

    def begin(keeper: object = None) -> RunningScripts:
        scripts, present = RunningScripts(), keeper or bench.keeper
        listeners.append(RecorderListener(present, scripts, address))  # type: ignore[arg-type]
        return scripts

    yield begin
    for listener in listeners:
        listener.close()


def test_requests_are_answered_and_the_state_is_shown(
    bench: Bench,
    listen: Callable[..., RunningScripts],
    address: PrivateAddress,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    accept, failing = Listener.accept, [True, True]

    def accept_later(listener: Any) -> Any:
        if failing:
            failing.pop()
            raise OSError("Too many open files")
        return accept(listener)

    monkeypatch.setattr(Listener, "accept", accept_later)
    page = Page()
    link = linked(page, address)
    with pytest.raises(InputError, match="is not ready"):
        link.ask(StartEpisode(), ADA)
    listen()
    # It waits for the process that records.
    answer = link.ask(StartEpisode(task="pour"), ADA, 5.0)
    until(lambda: page.shown.get(ENTRY))
    assert caplog.text.count("Too many open files") == 1
    assert answer["number"] == 1
    assert answer["by"] == {"name": "Ada", "role": "operator"}
    until(lambda: page.shown[ENTRY]["running"])
    with pytest.raises(InputError, match="runs already"):
        link.ask(StartEpisode(), ADA)
    bench.move(40)
    assert link.ask(StopEpisode(), ADA)["outcome"] == "unjudged"


def test_without_a_folder_of_episodes_the_reason_is_the_answer(
    listen: Callable[..., RunningScripts], address: PrivateAddress
) -> None:
    page = Page()
    scripts = listen(InputError("Another server uses it."))
    link = linked(page, address)
    until(lambda: link._connection)
    with pytest.raises(InputError, match="Another server uses it"):
        link.ask(StartEpisode(), ADA)
    link.note("turn", "name: turn", 1.0, None)
    until(lambda: scripts._runs)


def test_scripts_are_noted_again_and_end_with_the_process_that_runs_them(
    listen: Callable[..., RunningScripts], address: PrivateAddress
) -> None:
    page = Page()
    link = linked(page, address)
    link.note("early", "name: early", 1.0, None)
    link.note("early", "name: early", 1.0, 2.0)
    link.note("long", "name: long", 3.0, None)
    scripts = listen()
    until(lambda: len(scripts._runs) == 2)
    early, running = scripts.read()
    assert (early.ended, running.ended) == (2.0, None)
    # One that has ended is returned once.
    assert [run.name for run in scripts.read()] == ["long"]
    # The process that records is started again.
    newest = link._connection
    assert newest is not None
    scripts = listen()
    disconnect(newest)
    until(lambda: 3.0 in scripts._runs)
    until(lambda: link._connection not in (None, newest))
    # The page's server ends.
    link._address = PrivateAddress(f"{address.name}-gone", b"")
    assert link._connection is not None
    disconnect(link._connection)
    until(lambda: scripts._runs[3.0].ended is not None)


def test_process_that_hangs_is_not_waited_for(
    address: PrivateAddress, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_link, "GREETING_SECONDS", 0.05)
    page = Page()
    with Listener(address.name):
        link = linked(page, address)
        until(lambda: ENTRY in page.shown)
        with pytest.raises(InputError, match="is not ready"):
            link.ask(StartEpisode(), ADA)
