"""Check docs/api.md and the OpenAPI description against the message classes."""

from __future__ import annotations

import pytest

from docs import page_types
from docs.api import PAGE, added_requests, page
from katana450.arm.control.commands.act import Command, Request, classes_of, tag_of
from katana450.errors import InputError
from katana450.extensions.api_description import summary
from katana450.server.api import answers, requests

ADDED = tuple(kind for kinds in added_requests().values() for kind in kinds)
"""Requests of the built-in extensions."""

EVERY_REQUEST: tuple[type[Request], ...] = (*requests.CORE, *ADDED)


def test_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run `python -m docs.api`"


def test_types_of_the_page_are_up_to_date() -> None:
    text = page_types.FILE.read_text(encoding="utf-8")
    assert text == page_types.content(), "run `python -m docs.page_types`"
    # An act may leave out a default, an answer only at its top; what it contains is complete.
    assert 'interface Rename { do: "rename"; id?: number | string | null;' in text
    assert "interface Finding { reason: string; text: string; amount: number | null;" in text


def test_every_message_is_documented() -> None:
    text = PAGE.read_text(encoding="utf-8")
    messages = ((EVERY_REQUEST, "do"), (answers.EVERY, "is"))
    for listed, tag in messages:
        for kind in listed:
            assert f'### `"{tag}": "{tag_of(kind.__name__)}"`' in text
            assert len(summary(kind)) > 5, kind


def test_every_request_class_is_a_request_and_declares_its_traits() -> None:
    declared = {kind for kind in classes_of(Request) if "traits" in vars(kind)}
    assert {kind for kind in declared if "tests" not in kind.__module__} == set(EVERY_REQUEST)
    for kind in EVERY_REQUEST:
        assert kind.traits.extension == (kind in ADDED)
        # The end of a motion can be waited for, not that of a stream or a question.
        waits = issubclass(kind, requests.MotionRequest)
        assert not (waits and (kind.traits.at_once or kind.traits.question or kind.traits.free))
    assert [kind for kind in EVERY_REQUEST if kind.traits.safety] == [requests.Stop]


def test_lease_requests_and_heartbeats_cost_no_budget() -> None:
    kinds = [kind for kind in EVERY_REQUEST if kind.traits.free]
    assert {kind.__name__ for kind in kinds} == {
        *("Stop", "ClearStop", "Heartbeat"),
        *("Acquire", "Take", "Ask", "Withdraw", "Give", "Decline", "ReleaseLease"),
    }
    assert not any(kind.traits.question for kind in kinds)


@pytest.mark.parametrize(
    "text",
    [
        '{"do": "hold", "finding": {"reason": "loop late"}}',
        '{"do": "hold_for", "finding": {"reason": "loop late"}}',
        '{"do": "pause_for", "finding": {"reason": "loop late"}}',
        '{"do": "servo", "q": [0.1], "t": 1.0}',
        '{"do": "timed_servo", "q": [0.1], "t": 1.0}',
        '{"do": "stop", "cause": {"why": "Somebody else."}}',
        '{"do": "clear_stop", "known": 1e9}',
        '{"do": "batch", "commands": []}',
        '{"do": "set_axes", "values": []}',
    ],
)
def test_what_only_the_server_gives_is_no_request(text: str) -> None:
    with pytest.raises(InputError, match=r"no request|unknown field"):
        requests.RequestDecoder(ADDED).decoded(text)


def test_acts_are_named_once() -> None:
    """A person presses STOP, and the gate makes the command with its cause."""
    names = [kind.__name__ for kind in {*classes_of(Command), *EVERY_REQUEST}]
    assert {name for name in names if names.count(name) > 1} == {"Stop", "ClearStop"}
