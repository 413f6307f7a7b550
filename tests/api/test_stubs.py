"""The clients have a method for each act, and the stubs of these methods are up to date."""

from __future__ import annotations

import asyncio
import inspect
from typing import Any

import numpy as np
import pytest

from docs.stubs import STUBS
from katana450.client import AsyncClient, Client
from katana450.client.acts import METHODS, OWN, Acts
from katana450.client.files import EpisodeClient
from katana450.server.api import requests


def test_stubs_are_up_to_date() -> None:
    for file, content in STUBS.items():
        assert file.read_text(encoding="utf-8") == content(), "run `python -m docs.stubs`"


def test_each_act_has_a_method_that_hides_none_of_the_clients() -> None:
    assert {*METHODS.values(), *OWN} == set(requests.EVERY)
    for client in (AsyncClient, Client):
        for name in METHODS:
            assert getattr(client, name) is getattr(Acts, name), "add the act to OWN"
    # Others are asked for or sent as objects, or by a method of another name.
    assert {kind.__name__ for kind in OWN if not hasattr(Client, kind.__name__.lower())} == {
        *("ClearStop", "ContinueFrom", "Heartbeat", "Hello", "Watch"),
    }


def test_signature_and_documentation_are_those_of_the_class() -> None:
    assert str(inspect.signature(Client.nudge)) == "(self, axis, by)"
    assert str(inspect.signature(EpisodeClient.judge)) == "(self, outcome, number=None)"
    text = inspect.getdoc(Client.joint) or ""
    assert text.startswith("Move one joint to a value.")
    assert "Args:\n    axis: Number of the joint, counted from 1." in text


class Recorder(Acts[Any, Any, Any]):
    """A client that returns how it is asked."""

    def go(self, request: requests.Request) -> tuple[str, requests.Request]:
        return "go", request

    def ask(self, request: requests.Request) -> tuple[str, requests.Request]:
        return "ask", request

    def send(self, request: requests.Request) -> tuple[str, requests.Request]:
        return "send", request


def test_motions_are_waited_for_samples_sent_and_other_acts_answered() -> None:
    client = Recorder()
    assert client.nudge(2, by=0.1) == ("go", requests.Nudge(axis=2, by=0.1))
    assert client.pause() == ("ask", requests.Pause())
    way, jog = client.jog([0.0, 0.0, 0.1, 0.0, 0.0])
    assert way == "send"
    np.testing.assert_equal(jog.rates, (0.0, 0.0, 0.1, 0.0, 0.0))
    with pytest.raises(TypeError, match="by"):
        client.nudge(2)  # type: ignore[call-arg]


def test_methods_of_the_asynchronous_client_are_awaited() -> None:
    class Waiting(Acts[Any, Any, Any]):
        async def go(self, request: requests.Request) -> requests.Request:
            return request

    assert asyncio.run(Waiting().home()) == requests.Home()
