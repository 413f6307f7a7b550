"""The QR code of the server's address: in the bar, for a finger in the small menu."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
import zxingcpp

from katana450.extensions.phone.address import LOOPBACK_ONLY, own_address
from tests.browser.conftest import OpenPage
from tests.browser.server import APP, AppServer
from tests.browser.sight import contrast
from tests.browser.sizes import LANDSCAPE, PHONE, PORTRAIT, WIDE

SIZES = {"desk": (WIDE, {}), "portrait": (PORTRAIT, PHONE), "landscape": (LANDSCAPE, PHONE)}


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer((*APP, "--host", "0.0.0.0", "--insecure")) as server:
        yield server


@pytest.mark.long
@pytest.mark.skipif(own_address() is None, reason="this machine is in no network")
@pytest.mark.parametrize(
    ("size", "scheme"),
    [
        ("portrait", "light"),
        pytest.param("desk", "dark", marks=pytest.mark.long),
        pytest.param("landscape", "dark", marks=pytest.mark.long),
    ],
)
def test_code_on_the_screen_holds_the_address(
    server: AppServer, open_page: OpenPage, artefacts: Path, size: str, scheme: str
) -> None:
    window, options = SIZES[size]
    page = open_page(server.url, nodes=("/arm",), window=window, color_scheme=scheme, **options)
    if size == "desk":
        button = page.page.locator("#phone-bar")
    else:
        page.page.click("#more-button")
        button = page.page.locator("#phone-button")
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
    page.keep(artefacts / f"phone-{size}-{scheme}.png")
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
    assert button.get_attribute("aria-expanded") == "false"
    assert page.errors == []


@pytest.mark.long
def test_page_of_a_server_on_loopback_says_how_to_let_a_phone_in(
    open_page: OpenPage, artefacts: Path
) -> None:
    with AppServer() as server:
        page = open_page(server.url, nodes=("/arm",))
        page.page.click("#phone-bar")
        page.page.locator("#phone p", has_text="on this machine only").wait_for()
        assert page.page.inner_text("#phone p") == LOOPBACK_ONLY
        assert page.page.locator("#phone img").count() == 0
        page.keep(artefacts / "phone-loopback.png")
        # The menu, which opens in the same corner, is not covered.
        page.page.click("#more-button")
        page.page.locator("#phone").wait_for(state="hidden")
        page.page.click("#own-name", trial=True)
        assert page.errors == []
