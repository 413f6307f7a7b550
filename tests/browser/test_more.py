"""The small menu of the page: the person's name, a picture of the scene, a link to the view."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import imageio.v3 as imageio
import numpy as np
import pytest

from tests.browser.conftest import OpenPage
from tests.browser.server import AppServer
from tests.browser.session import Truth, bar


@pytest.mark.long
def test_person_chooses_a_name_and_saves_picture_and_link(
    server: AppServer, open_page: OpenPage, tmp_path: Path, artefacts: Path
) -> None:
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

    page.press_in_bar("Copy link to this view")
    link = page.page.get_by_label("Link to this view")
    page.wait_until(lambda: link.input_value() != "", "the link")
    query = parse_qs(urlsplit(link.input_value()).query)
    view = page.sent("ViewerCameraMessage")[-1].body
    for key, wanted in (("Position", "position"), ("LookAt", "look_at")):
        found = [float(x) for x in query[f"initialCamera{key}"][0].split(",")]
        assert found == pytest.approx(list(view[wanted]), abs=1e-3)
    assert page.errors == []
    assert other.errors == []


@pytest.mark.long
def test_chosen_name_returns_with_a_restarted_server(open_page: OpenPage) -> None:
    with AppServer() as server:
        page = open_page(server.url, nodes=("/arm",))
        page.page.click("#more-button")
        page.page.get_by_label("Your name").fill("Anna")
        page.page.keyboard.press("Enter")
        page.wait_until(lambda: bar(page, "name").startswith("Anna"), "the name")
        server.kill()
        page.wait_lost()
        page.wait_until(lambda: bar(page, "headline") == "No connection", "the loss")
        server.restart()
        page.wait_until(lambda: bar(page, "headline") != "No connection", "the state", seconds=30.0)
        page.press_in_bar("Take")
        page.wait_until(lambda: Truth(server).status()["holder"] == "Anna", "the name")
