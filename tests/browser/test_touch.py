"""Touch in a real browser: the pressure maps, and the vibration of a gamepad and a phone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from katana450.client import Client, connect
from katana450.maths.geometry import se3
from katana450.server.api import answers, requests
from tests.browser.server import AppServer

OPEN, CLOSED = 0.3, -0.44
ROD, ROD_AT = [0.015, 0.31], (0.4477, 0.0)
"""[m] Radius and height of a rod, and its place below the fingers in the ready posture."""

DEVICES = """
    window.felt = [];
    const playEffect = (kind, effect) => (felt.push({ kind, ...effect }), Promise.resolve());
    const pad = {
        connected: true, buttons: [], axes: [], vibrationActuator: { playEffect },
    };
    navigator.getGamepads = () => [null, pad];
    navigator.vibrate = (ms) => felt.push({ kind: "phone", duration: ms });
    // The frame of the scene has no storage.
    try { localStorage.setItem("katana450.welcome", "seen"); } catch {}
"""
"""A gamepad and a phone that note what they play."""

FEEL = """async ([states, haptic]) => {
    const { Rumble } = await import("/static/touch/rumble.js");
    const rumble = new Rumble();
    const kept = navigator.getGamepads;
    const pulse = (value, duration) => felt.push({ kind: "haptic", value, duration });
    if (haptic) navigator.getGamepads = () => [{ connected: true, hapticActuators: [{ pulse }] }];
    felt.splice(0);
    states.forEach((state, i) => rumble.take(state, 1000 * i));
    navigator.getGamepads = kept;
    return felt.splice(0);
}"""
"""Returns what the devices play for states that follow each other after a second."""

INK = """(map) => {
    const { width, height } = map.querySelector("canvas");
    const { data } = map.querySelector("canvas").getContext("2d").getImageData(0, 0, width, height);
    return data.filter((value, i) => i % 4 === 3 && value > 0).length;
}"""
"""Returns the number of coloured taxels of a map."""


@pytest.fixture(scope="module")
def arm(server: AppServer) -> Iterator[Client]:
    """Return a program that drives, with a rod that stands between the open fingers."""
    x, y = ROD_AT
    T = se3.from_rotation_translation(np.eye(3), np.array((x, y, 0.0)))
    with connect(server.url, "Tester") as arm:
        grip(arm, OPEN)
        shape = requests.Shape.CYLINDER
        rod = requests.Place(name="rod", T=T, shape=shape, size=ROD, can_be_held=True)
        assert isinstance(arm.ask(rod), answers.Done)
        grip(arm, CLOSED)
        assert arm.query(answers.State).held == "rod"
        yield arm


def grip(arm: Client, angle: float) -> None:
    arm.go(requests.Gripper(angle=angle))


@pytest.fixture
def page(server: AppServer, arm: Client, browser: Browser) -> Iterator[Page]:
    """Return our own page without viser in its frame, with the devices."""
    grip(arm, CLOSED)
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.add_init_script(DEVICES)
    context.route("**/viser/**", lambda route: route.abort())
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(server.url)
    yield page
    assert errors == []
    context.close()


def test_maps_show_force_and_centre_of_pressure(page: Page, arm: Client) -> None:
    page.click("#instruments-button")
    card = page.locator("#instruments .card[data-id=pads]")
    card.wait_for()
    for side in ("Left", "Right"):
        force = card.locator("section", has_text=side).locator("output")
        page.wait_for_function(
            "(each) => each.textContent === '10.0 N'", arg=force.element_handle()
        )
        found = card.get_by_role("img", name=f"{side} pad")
        assert 8 <= found.evaluate(INK) <= 64
        assert "10.0 N, centre of pressure" in (found.get_attribute("aria-label") or "")
        assert found.locator("i").is_visible()
    grip(arm, OPEN)
    page.wait_for_function(
        """() => [...document.querySelectorAll(".pressure output")]
          .every((each) => each.textContent === "0.0 N")"""
    )
    for found in card.get_by_role("img").all():
        assert found.evaluate(INK) == 0
        assert not found.locator("i").is_visible()
    state = arm.query(answers.State)
    assert state.touch is not None
    assert state.touch["pads"][0]["pressure"] == []
    grip(arm, CLOSED)


def felt(page: Page) -> list[dict[str, Any]]:
    """Return what the devices have played since the last call."""
    found: list[dict[str, Any]] = page.evaluate("() => felt.splice(0)")
    return found


@pytest.mark.long
def test_devices_vibrate_only_after_they_were_turned_on(page: Page, arm: Client) -> None:
    grip(arm, OPEN)
    page.click("#more-button")
    button = page.get_by_role("button", name="Vibrate on touch")
    assert button.get_attribute("aria-pressed") == "false"
    assert felt(page) == []
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    page.wait_for_timeout(300)
    felt(page)
    grip(arm, CLOSED)
    page.wait_for_function("() => felt.some(({ strongMagnitude }) => strongMagnitude > 0.9)")
    played = felt(page)
    assert {each["kind"] for each in played} == {"dual-rumble", "phone"}
    strong = max(each.get("strongMagnitude", 0.0) for each in played)
    assert 0.9 < strong <= 1.0
    assert all(each["duration"] > 0 for each in played)
    # A force that lasts is not felt. States that were under way may still tell of the approach.
    page.wait_for_timeout(400)
    assert not [each for each in felt(page) if each.get("strongMagnitude")]
    page.wait_for_timeout(400)
    assert felt(page) == []
    # A joint near its limit is felt on the weak motor alone.
    lower, upper = (arm.query(answers.Arm).lower[4], arm.query(answers.Arm).upper[4])
    assert lower < upper
    arm.go(requests.Joint(axis=5, value=upper))
    near = [each for each in felt(page) if each["kind"] == "dual-rumble"]
    assert near
    assert all(each["strongMagnitude"] == 0 and each["weakMagnitude"] > 0 for each in near)
    assert {each["duration"] for each in near} == {30}
    button.click()
    arm.go(requests.Joint(axis=5, value=upper - 0.02))
    assert felt(page) == []


def state(*reasons: str, **values: Any) -> dict[str, Any]:
    """Return the part of a state that is felt: an arm that moves freely, with changes."""
    force = values.pop("force", 0.0)
    touch = {"force_limit": 10.0, "pads": [{"force": force}, {"force": force}]}
    margins = {"clearance": values.pop("clearance", 0.1), "limit": values.pop("limit", 1.0)}
    findings = [{"reason": reason} for reason in reasons]
    return {
        **{"moving": True, "findings": findings, "margins": margins},
        **{"touch": touch, "touching": [], **values},
    }


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("found", "strong", "weak"),
    [
        (state(), None, None),
        (state(moving=False, clearance=0.006, limit=0.01), None, None),
        (state(clearance=0.006), 0.0, (0.5, 1.0)),
        (state(limit=0.01), 0.0, (0.5, 1.0)),
        (state("contact", moving=False), 0.0, (1.0, 1.0)),
        (state(touching=["cup"]), 0.0, (0.6, 0.6)),
        (state(force=5.0), 0.6, (0.2, 0.2)),
        (state("sliding", force=0.0), 1.0, (1.0, 1.0)),
        (state("slipped"), 1.0, (1.0, 1.0)),
    ],
    ids=["free", "rest", "near", "limit", "blocked", "touch", "grip", "sliding", "slipped"],
)
def test_each_event_is_felt_on_its_motor_and_on_the_phone(
    page: Page, found: dict[str, Any], strong: float | None, weak: tuple[float, float] | None
) -> None:
    played = page.evaluate(FEEL, [[state(), found], False])
    if strong is None or weak is None:
        assert played == []
        return
    gamepad, phone = played
    assert gamepad["kind"] == "dual-rumble"
    assert gamepad["strongMagnitude"] == pytest.approx(strong)
    assert weak[0] <= gamepad["weakMagnitude"] <= weak[1]
    strength = max(gamepad["strongMagnitude"], gamepad["weakMagnitude"])
    assert phone["kind"] == "phone"
    assert phone["duration"] == pytest.approx(gamepad["duration"] * strength, abs=1.0)
    # The one motor of a gamepad in Firefox has the stronger of both.
    (haptic, _) = page.evaluate(FEEL, [[state(), found], True])
    assert haptic == {"kind": "haptic", "value": strength, "duration": gamepad["duration"]}


@pytest.mark.long
def test_choice_is_kept_for_the_next_visit(page: Page, arm: Client) -> None:
    page.click("#more-button")
    page.get_by_role("button", name="Vibrate on touch").click()
    page.wait_for_function("() => localStorage.getItem('katana450.rumble') === 'yes'")
    page.reload()
    page.wait_for_function("() => document.querySelector('#rumble-button').ariaPressed === 'true'")
    grip(arm, OPEN)
    felt(page)
    grip(arm, CLOSED)
    page.wait_for_function("() => felt.some(({ strongMagnitude }) => strongMagnitude > 0.5)")
