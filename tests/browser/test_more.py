"""The small menu of the page: name, picture, code for a phone, and another robot."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
import zxingcpp

from katana450.extensions.phone import own_address
from tests.browser.camera import Drawing
from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, AppServer
from tests.browser.session import Truth, bar
from tests.browser.sight import contrast
from tests.browser.test_accessibility import findings
from tests.browser.test_objects import drop
from tests.exchange.shape_bytes import zipped
from tests.extensions.test_robot_choice import urdf


@pytest.mark.long
def test_person_chooses_a_name_and_saves_picture_and_link(
    server: AppServer, own_page: ViserPage, open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
    own_page.press_in_bar("Release")
    page, other = (open_page(server.url, nodes=("/arm",)) for _ in range(2))
    name, why = page.page.get_by_label("Your name"), page.page.locator("#own-name-why")
    number = bar(other, "name").partition(",")[0]
    page.page.click("#more-button")
    for text, words in (("", "empty"), ("x" * 30, "30 characters"), (number, "not a name of one")):
        name.fill(text)
        name.press("Enter")
        why.filter(has_text=words).wait_for()
    page.keep(artefacts / "more.png")
    name.fill("")
    # The blank is typed, and stops nothing.
    name.type("Anna B")
    name.press("Enter")
    page.wait_until(lambda: bar(page, "name").startswith("Anna B"), "the name")
    assert Truth(server).status()["stopped"] is None
    assert not page.page.locator("#more").is_visible()
    assert page.page.evaluate("() => localStorage.getItem('katana450.name')") == "Anna B"
    page.press_in_bar("Take")
    other.wait_until(lambda: bar(other, "holder") == "Anna B drives", "the name at the other page")

    page.page.click("#more-button")
    page.frame.evaluate("() => harness.draw(true)")
    page.wait_drawn()
    with page.page.expect_download() as downloading:
        page.press_in_bar("Save a picture of the scene")
    assert downloading.value.suggested_filename.startswith("katana450-")
    downloading.value.save_as(tmp_path / "scene.png")
    picture = np.asarray(imageio.imread(tmp_path / "scene.png"))[..., :3]
    assert np.ptp(picture.reshape(-1, 3), axis=0).min() > 100
    assert page.errors == []
    assert other.errors == []


@pytest.mark.skipif(own_address() is None, reason="this machine is in no network")
@pytest.mark.long
def test_code_of_a_server_of_one_machine_is_the_command_that_opens_it(own_page: ViserPage) -> None:
    page = own_page.page
    page.evaluate("navigator.clipboard.writeText = async (text) => { window.copied = text }")
    page.click("#phone-bar")
    command = page.get_by_label("Command that opens the server")
    command.wait_for()
    assert "this machine only" in page.inner_text("#phone p")
    page.locator("#phone").get_by_role("button", name="Copy").click()
    page.wait_for_function("() => window.copied")
    assert page.evaluate("copied") == command.input_value()
    assert "katana450 serve --host 0.0.0.0" in command.input_value()
    page.click("#phone form button")


@pytest.mark.long
@pytest.mark.skipif(own_address() is None, reason="this machine is in no network")
def test_code_on_the_screen_holds_the_address(open_page: OpenPage, artefacts: Path) -> None:
    with AppServer((*APP, "--host", "0.0.0.0", "--insecure")) as server:
        page = open_page(server.url, drawing=Drawing.NONE)
        assert_code_holds_the_address(page, server, artefacts)


def assert_code_holds_the_address(page: ViserPage, server: AppServer, artefacts: Path) -> None:
    button = page.page.locator("#phone-bar")
    button.click()
    url = f"http://{own_address()}:{server.port}"
    address = page.page.get_by_label("Address for a phone")
    address.wait_for()
    assert address.input_value() == url
    assert button.get_attribute("aria-expanded") == "true"
    code = page.page.get_by_role("img", name=f"QR code of {url}")
    code.scroll_into_view_if_needed()
    page.wait_until(lambda: code.evaluate("(each) => each.naturalWidth") > 0, "the code")
    picture = np.asarray(imageio.imread(page.page.screenshot(), extension=".png"))[..., :3]
    (read,) = zxingcpp.read_barcodes(np.ascontiguousarray(picture))
    assert read.text == url
    page.keep(artefacts / "phone.png")
    note = page.page.locator("#phone p")
    assert "Everybody who opens this address can drive the arm." in note.inner_text()
    colours: list[str] = note.evaluate(
        "(each) => [getComputedStyle(each).color, "
        "getComputedStyle(document.getElementById('phone')).backgroundColor]"
    )
    assert contrast(*colours) >= 4.5
    # Nothing is cut, and STOP stays in reach.
    assert page.page.locator("#phone").evaluate("(each) => each.scrollWidth <= each.clientWidth")
    page.page.click("#stop", trial=True)
    page.page.click("#phone form button")
    code.wait_for(state="hidden")
    page.wait_until(lambda: button.get_attribute("aria-expanded") == "false", "it is closed")
    assert page.errors == []


@pytest.mark.long
def test_another_robot_is_opened_and_every_window_loads_again(
    open_page: OpenPage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, artefacts: Path
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with AppServer(APP) as server:
        windows = [open_page(server.url, drawing=Drawing.NONE) for _ in range(2)]
        page = windows[0].page
        page.click("#more-button")
        page.click("#robots-button")
        page.get_by_role("button", name="Katana450").wait_for()
        page.get_by_label("Search a robot").fill("nothing")
        page.get_by_text("No robot has this name or maker.").wait_for()
        assert findings(page) == []
        windows[0].keep(artefacts / "robots.png")
        starts = [window.page.evaluate("performance.timeOrigin") for window in windows]
        page.locator("#robots").get_by_role("button", name="Close").click()
        # A dropped archive of a robot is no object, and is driven only when a person says so.
        drop(windows[0], small_zip=zipped({"small/small.urdf": urdf()}))
        page.get_by_role("button", name="Drive it").click()
        for window, time_origin in zip(windows, starts, strict=True):
            window.page.wait_for_function(
                "(begun) => performance.timeOrigin > begun", arg=time_origin, timeout=40_000
            )
            window.page.locator("#holder").filter(has_text="drives").wait_for()
        assert [window.errors for window in windows] == [[], []]
