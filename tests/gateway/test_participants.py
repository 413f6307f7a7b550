"""People whom a server knows: their names, and a link that ends."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Person, Role
from katana450.errors import InputError
from katana450.server.service import status
from katana450.server.service.participants import MAX_NAME, MAX_PAGES, renamed
from katana450.server.web.access_links import AccessFile
from tests.gateway.client import HOUR
from tests.gateway.test_hub import PAGES, Table
from tests.gateway.virtual import VirtualServer


async def test_request_whose_link_ends_before_its_body_is_refused(
    guarded: VirtualServer, file: AccessFile
) -> None:
    token = file.give("Oda", Role.OPERATOR, time.time() + HOUR)
    (number,) = file.grants

    async def do(what: str, meanwhile: Callable[[], object] = lambda: None) -> int:
        body = b'{"do": "%s"}' % what.encode()
        names: dict[str, Any] = {"X_Program": "a-program-of-this-test"}
        names["Authorization"] = f"Bearer {token}"
        return (await guarded.request("/api/v1/do", body, meanwhile=meanwhile, **names))[0]

    assert (await do("acquire"), await do("release_lease")) == (200, 200)
    assert await do("acquire", lambda: file.revoke(number)) == 401
    assert guarded.hub.lease.holder is None


def test_new_name_is_seen_everywhere_and_the_driver_keeps_the_arm(table: Table) -> None:
    driver, other = (table.join(page) for page in PAGES)
    table.touch(driver.person.key)
    holds, revocations = table.arm.holds, table.hub.gate.revocations
    table.hub.rename(driver, "  Anna   B. ")
    assert status.of(table.hub, driver)["name"] == "Anna B."
    assert status.common(table.hub)["holder"] == "Anna B."
    assert status.of(table.hub, driver)["mine"]
    assert (table.arm.holds, table.hub.gate.revocations) == (holds, revocations)
    table.hub.gate.change(lambda lease, _: lease.request(other.person), other.actor)
    table.hub.rename(other, "Ben")
    assert [person["name"] for person in status.of(table.hub, driver)["asking"]] == ["Ben"]
    table.hub.move(driver, cmd.Pause())
    assert table.arm.actors[-1].name == "Anna B."
    # A page that is reloaded keeps its name.
    table.hub.leave(driver)
    assert table.join(PAGES[0]).person.name == "Anna B."


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "The name is empty"),
        ("  ", "The name is empty"),
        ("x" * (MAX_NAME + 1), f"The maximum is {MAX_NAME}"),
        ("window 2", "not a name of one person"),
        ("a\u202eb", "cannot be shown"),
        ("\u3164", "cannot be shown"),
        ("a" + "\u0301\u0302\u0303\u0304", "cannot be shown"),
        ("...", "not a name of one person"),
        ("You", "not a name of one person"),
        ("Window 261", "not a name of one person"),
        ("\uff37indow 3", "not a name of one person"),
    ],
)
def test_unsuitable_name_is_refused_in_words(table: Table, name: str, why: str) -> None:
    window, _ = (table.join(page) for page in PAGES)
    with pytest.raises(InputError, match=why):
        table.hub.rename(window, name)
    assert window.person.name == "Window 1"


def test_name_of_an_access_link_stays() -> None:
    with pytest.raises(InputError, match="access link"):
        renamed(Person("key", "Anna", Role.OPERATOR, link="7"), "Ben", ())


def test_name_of_somebody_who_is_away_stays_his(table: Table) -> None:
    first, second = (table.join(page) for page in PAGES)
    table.hub.rename(first, "Ann")
    table.hub.leave(first)
    with pytest.raises(InputError, match="is taken"):
        table.hub.rename(second, "ann")
    assert table.join(PAGES[0]).person.name == "Ann"
    # Saved as it is.
    table.hub.rename(second, "Window 2")


def test_connected_window_stays_known_among_many(table: Table) -> None:
    window = table.join(PAGES[0])
    for number in range(MAX_PAGES + 5):
        table.hub.leave(table.join(f"page-{number:032}"))
    table.hub.rename(window, "Ann")
    assert table.join(PAGES[0]).number == window.number
