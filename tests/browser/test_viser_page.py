"""Each part of viser's page that static/viser.js uses, tested on a real page of viser."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.camera import Camera
from tests.browser.conftest import OpenPage, Windows
from tests.browser.page import COARSE, ViserPage
from tests.browser.server import AppServer
from tests.browser.tapped_page import script
from tests.browser.viser_parts_app import EYE
from tests.viser_bridge.parts import part

APP = (sys.executable, str(Path(__file__).with_name("viser_parts_app.py")), "--port", "{port}")
NODES = ("/box", "/floor")
CAMERA = Camera((1.5, -0.5, 0.75), (0.0, 0.0, 0.25))
PORTRAIT = (390, 844)
HELD = Path(__file__).with_name("held.js").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer(APP) as server:
        yield server


@pytest.fixture(scope="module")
def page(windows: Windows, server: AppServer) -> Iterator[ViserPage]:
    """Open a window of viser's page with our script before its own program."""
    with windows.open(server.url, nodes=NODES, camera=CAMERA, script=script()) as page:
        yield page
        assert page.errors == []


def ask(page: ViserPage, what: str) -> Any:
    """Evaluate ``what`` in viser's document."""
    return page.frame.evaluate(f"() => {what}")


def eye(page: ViserPage) -> list[float]:
    """Return the camera position in viser's world."""
    place: list[float] = ask(
        page,
        "Viser.viewer().camera.position.clone()"
        ".applyMatrix4(Viser.node('').matrixWorld.clone().invert()).toArray()",
    )
    return place


def height(page: ViserPage) -> float:
    return float(page.node_pose("/box")[2, 3])


def test_page_takes_camera_and_resolution_from_its_address(page: ViserPage) -> None:
    with part("PARAMETER"):
        names = [part.partition("=")[0] for part in CAMERA.query(COARSE).split("&")]
        assert all(ask(page, f"Viser.PARAMETER.test('{name}')") for name in names)
        assert eye(page) == pytest.approx(CAMERA.position, abs=1e-3)
        assert (
            ask(page, "Viser.viewer().canvas.width / Viser.viewer().canvas.clientWidth") == COARSE
        )


def test_box_is_drawn_where_it_is_projected(page: ViserPage) -> None:
    red, _, blue = np.moveaxis(page.picture().astype(int), -1, 0)
    x, y = (round(value) for value in page.project((0.0, 0.0, 0.0)))
    assert red[y, x] > blue[y, x] + 50  # orange
    assert abs(red[y - 200, x] - blue[y - 200, x]) < 10  # the background is grey


def test_page_offers_its_scene(page: ViserPage) -> None:
    with part("viewer"):
        assert ask(page, "Viser.viewer().canvas.matches('canvas')")
        names = ("getPosition", "getTarget", "setPosition", "setTarget")
        for name in names:
            assert ask(page, f"typeof Viser.viewer().cameraControl.{name}") == "function"
        assert ask(page, "Viser.viewer().camera.fov") == pytest.approx(np.degrees(CAMERA.fov))
    with part("picture"):
        kind = "Viser.picture({ contentWindow: window }).then(({ type }) => type)"
        assert ask(page, kind) == "image/png"
    with part("thumbnail"):
        place = "{ contentWindow: window }, 96, 72"
        assert ask(page, f"Viser.thumbnail({place})").startswith("data:image/jpeg;base64,")
        assert ask(page, "Viser.thumbnail({}, 9, 9)") == ""
    with part("drawing"):
        assert ask(page, "Viser.drawing() === Viser.viewer()")
    with part("node"), part("nameOf"):
        assert ask(page, "Viser.nameOf(Viser.node('/box'))") == "/box"
        assert ask(page, "Viser.node('/box').isObject3D && Viser.node('').isObject3D")
        assert ask(page, "Viser.node('/none') === undefined")
    with part("world"):
        assert ask(page, "Viser.world() === Viser.node('')")


def test_page_publishes_its_decoder(page: ViserPage) -> None:
    with part("start"):
        assert ask(page, "window.__viserZstdWasm instanceof WebAssembly.Module")
        assert ask(page, "typeof Viser.start") == "function"


def test_page_draws_nothing_before_its_scene_is_whole(
    server: AppServer, open_page: OpenPage
) -> None:
    with part("hold"), part("isDrawn"), part("HELD"):
        page = open_page(server.url, nodes=NODES, script=script(HELD.replace("CALL", "")))
        assert ask(page, "drawings.includes(false) && drawings.includes(true)")
        held = HELD.replace("CALL", "Viser.hold();")
        page = open_page(server.url, nodes=NODES, script=script(held))
        assert ask(page, "drawings.length > 0 && !drawings.includes(false)")
        assert ask(page, "Viser.isDrawn() && !document.documentElement.matches('[data-held]')")
        assert ask(page, "Viser.HELD.includes('[data-held]')")
    with part("missing"):
        # The page waits for no label, as viser has no node for it.
        assert ask(page, "!Viser.node('/label')")
        assert ask(page, "Viser.missing()") == []


def test_page_finds_what_is_under_a_pixel(page: ViserPage) -> None:
    def found(name: str, others: str = "") -> bool:
        """Return whether the ray to the middle of a node meets its surface."""
        x, y = page.project(page.node_pose(name)[:3, 3])
        return bool(
            page.frame.evaluate(
                """([pixel, name, names]) => {
                    const hit = Viser.pick(pixel, names);
                    if (!hit) return false;
                    const place = Viser.node(name).getWorldPosition(hit.point.clone());
                    let owner = hit.object;
                    while (owner && owner !== Viser.node(name)) owner = owner.parent;
                    const away = hit.point.distanceTo(place);
                    return Boolean(owner) && away > 0.04 && away < 0.1;
                }""",
                [[x, y], name, [others or name]],
            )
        )

    with part("pick"):
        assert found("/box")
        assert not found("/box", "/held")
        assert not found("/box", "/none")
        # The handle is in front of this one, and takes the pointer.
        assert not found("/held")
    with part("partAt"), part("owner"):
        pixels = [list(page.project(page.node_pose(name)[:3, 3])) for name in ("/held", "/box")]
        acts = "(part) => Viser.owner(part, (each) => each.__r3f?.handlers?.onPointerDown)"
        whose = (
            f"(pixels) => pixels.map(Viser.partAt).map((part) => part && part === ({acts})(part))"
        )
        assert page.frame.evaluate(whose, pixels) == [True, None]
    with part("pick"):
        # What is not shown is not met.
        shapes = "Viser.node('/box').traverse((each) => each.isMesh && (each.visible = {}))"
        ask(page, shapes.format("false"))
        assert not found("/box")
        ask(page, shapes.format("true"))
        assert found("/box")
    with part("viewer"):
        assert ask(page, "typeof Viser.viewer().requestRender") == "function"


def test_page_speaks_to_its_worker_as_expected(page: ViserPage, server: AppServer) -> None:
    with part("interceptMessages"):
        assert ask(page, "tapped.address") == server.url.replace("http", "ws", 1)
        assert ask(page, "tapped.connected") == 1
        assert "ViewerCameraMessage" in ask(page, "tapped.sends")
        # A message of our own, in each direction.
        (slider,) = page.messages("GuiSliderMessage")
        page.frame.evaluate(
            """(uuid) => tapped.line.say(
                { type: "GuiUpdateMessage", uuid, updates: { value: 0.4 } })""",
            slider.body["uuid"],
        )
        page.wait_until(lambda: abs(height(page) - 0.4) < 1e-6, "the message to the server")
        page.frame.evaluate(
            """() => tapped.line.show(
                [{ type: "SetPositionMessage", name: "/box", position: [0, 0, 0.9] }])"""
        )
        page.wait_until(lambda: abs(height(page) - 0.9) < 1e-6, "what was shown to the page")
        ask(page, "tapped.withheld = 'GuiUpdateMessage'")
        page.type_number("Height", 1.5)
        page.page.wait_for_timeout(200)
        ask(page, "tapped.withheld = null")
        assert height(page) == pytest.approx(0.9)
    with part("replayed"):
        assert ask(page, "tapped.replayed") == 1
    with part("controlsIn"):
        # Only its first messages: what followed changed values.
        assert ask(page, "tapped.panels") == 1


def test_page_tells_and_takes_views(page: ViserPage) -> None:
    with part("viewOf"):
        view = ask(page, "tapped.views.at(-1)")
        assert [len(view[key]) for key in ("position", "look_at")] == [3, 3]
    with part("viewsIn"):
        position, _ = ask(page, "tapped.sets[0]")
        assert (position["initial"], position["position"]) == (True, list(EYE))
        page.click_button("Front")
        page.wait_until(lambda: ask(page, "tapped.sets.length") == 2, "the view of the server")
        position, target = ask(page, "tapped.sets[1]")
        assert (position["initial"], position["position"]) == (False, [2.0, 0.0, 0.5])
        assert len(target["look_at"]) == 3
    with part("choiceOf"):
        assert ask(page, "tapped.choices") == [{"label": "View", "value": "Front"}]
    with part("press"):
        ask(page, "Viser.press('View', 'Side')")
        page.wait_until(lambda: ask(page, "tapped.sets.length") == 3, "the view of the server")
        assert ask(page, "tapped.choices.at(-1)") == {"label": "View", "value": "Side"}
    with part("send"):
        look = "harness.sent.findLast(({ type }) => type === 'ViewerCameraMessage').body"
        ask(page, f"Viser.send({{ ...{look}, fov: 0.5 }})")
        # The camera, which may still turn to the side, sends others after it.
        assert ask(page, "harness.sent.some(({ body }) => body.fov === 0.5)")


def test_page_shows_a_hidden_node_by_itself(page: ViserPage) -> None:
    with part("reveal"):
        assert not page.shows("/hidden")
        for argument, wanted in ((", true", True), ("", False)):
            ask(page, f"Viser.reveal('/hidden'{argument})")
            page.wait_until(lambda wanted=wanted: page.shows("/hidden") is wanted, f"{wanted}")  # type: ignore[misc]


def test_page_hides_nodes_by_itself(page: ViserPage) -> None:
    with part("hideNodes"):
        for hides, shown in (("(name) => name === '/box'", False), ("null", True)):
            ask(page, f"Viser.hideNodes({hides})")
            page.wait_until(lambda wanted=shown: page.shows("/box") is wanted, "the node")  # type: ignore[misc]
            with part("hasHidden"):
                assert ask(page, "Viser.hasHidden()") is not shown
    with part("handles"):
        sent = {message["type"] for message in ask(page, "harness.sent")}
        assert not any(ask(page, f"Viser.handles({{ type: '{kind}' }})") for kind in sent)
        for handled in ("TransformControlsUpdateMessage", "SceneNodeClickMessage"):
            assert ask(page, f"Viser.handles({{ type: '{handled}' }})")
    with part("phaseOf"):
        kinds = ("DragStart", "Update", "DragEnd")
        phases = [f"Viser.phaseOf({{ type: 'TransformControls{kind}Message' }})" for kind in kinds]
        assert ask(page, f"[{', '.join(phases)}]") == ["Start", "Update", "End"]
        assert ask(page, "Viser.phaseOf({ type: 'SceneNodeClickMessage' }) === undefined")
    with part("controls"):
        assert ask(page, "Viser.controls({ type: 'GuiUpdateMessage' })")


def test_page_is_painted_by_changed_messages(page: ViserPage) -> None:
    scheme = "document.documentElement.dataset.mantineColorScheme"
    with part("paint"):
        kinds = {"ThemeConfigurationMessage", "GridMessage", "BackgroundImageMessage"}
        assert set(ask(page, "[...tapped.painted.keys()]")) == kinds
        for name in ("cell_color", "section_color", "plane_color", "shadow_opacity"):
            assert ask(page, f"'{name}' in tapped.painted.get('GridMessage').props"), name
        assert ask(page, "'rgb_data' in tapped.painted.get('BackgroundImageMessage')")
        assert ask(page, scheme) == "light"
        for dark in ("true", "false"):
            ask(
                page,
                "tapped.line.show(Viser.paint([structuredClone("
                f"tapped.painted.get('ThemeConfigurationMessage'))], {{ dark: {dark}, sky: '' }}))",
            )
            wanted = "dark" if dark == "true" else "light"
            page.wait_until(lambda wanted=wanted: ask(page, scheme) == wanted, wanted)  # type: ignore[misc]
    with part("STEADY"):
        faint = "(Viser.viewer().canvas.style.opacity = '0.05', Viser.viewer().canvas)"
        assert ask(page, f"getComputedStyle({faint}).opacity") == "1"
        assert ask(page, "document.querySelector('#root').childElementCount") > 0


def test_number_boxes_are_found_and_filled(page: ViserPage) -> None:
    boxes = "[...document.querySelectorAll(Viser.NUMBER_BOX)]"
    (slider,) = page.messages("GuiSliderMessage")
    (vector,) = page.messages("GuiVector3Message")
    with part("NUMBER_BOX"):
        assert ask(page, f"{boxes}.length") == 4
    with part("controlOf"):
        boxes_found = ask(page, f"{boxes}.map(Viser.controlOf)")
        expected = [(slider.body["uuid"], "Height", 0)]
        expected += [(vector.body["uuid"], "Point", index) for index in range(3)]
        assert [(box["id"], box["label"], box["index"]) for box in boxes_found] == expected
    with part("keepControls"):
        controls = ask(page, "[...tapped.controls.values()]")
        assert [(control["min"], control["max"], control["step"]) for control in controls] == [
            (-1.0, 2.0, 0.1),
            ([-5.0, -6.0, -7.0], [5.0, 6.0, 7.0], 0.5),
        ]
    with part("shownIn"):
        shown = ask(page, f"{boxes}.slice(1).map(Viser.shownIn)")
        assert [float(text) for text in shown] == [1.0, 2.0, 3.0]
    with part("fill"):
        before = len(page.sent("GuiUpdateMessage"))
        ask(page, f"Viser.fill({boxes}[0], '1.9')")
        page.page.wait_for_timeout(200)
        assert len(page.sent("GuiUpdateMessage")) == before
    with part("type"):
        ask(page, f"Viser.type({boxes}[0], '1.2')")
        page.wait_until(lambda: abs(height(page) - 1.2) < 1e-6, "the number that was typed")
        assert float(ask(page, f"Viser.shownIn({boxes}[0])")) == 1.2


def test_notice_of_drawing_by_software_is_found_by_its_colour(page: ViserPage) -> None:
    count = "document.querySelectorAll(Viser.SOFTWARE_NOTICE).length"
    with part("SOFTWARE_NOTICE"):
        page.frame.evaluate(
            """() => tapped.line.show(["orange", "red"].map((color) => ({
                type: "NotificationShowMessage", uuid: color, props: {
                    title: color, body: "", loading: false, with_close_button: true,
                    auto_close_seconds: null, color,
                },
            })))"""
        )
        page.wait_until(lambda: ask(page, count) == 1, "the notice")


def test_hint_belongs_to_the_row_of_its_control(page: ViserPage) -> None:
    page.frame.get_by_role("button", name="Front", exact=True).hover()
    shown = "document.querySelectorAll(Viser.HINT).length"
    with part("HINT"):
        page.wait_until(lambda: ask(page, shown) == 1, "the hint")
        assert ask(page, "document.querySelector(Viser.HINT).textContent") == "Where to look from"
    with part("rowOf"):
        row = """(() => {
            const [view, other] = ["Side", "Front"].map((text) =>
                [...document.querySelectorAll("button")].find((each) => each.textContent === text));
            const box = document.querySelector(Viser.NUMBER_BOX);
            const row = Viser.rowOf(view);
            const labels = row.querySelectorAll("label[for]").length;
            return [row === Viser.rowOf(other), row === Viser.rowOf(box), labels];
        })()"""
        assert ask(page, row) == [True, False, 1]
    page.page.mouse.move(300, 300)
    page.wait_until(lambda: ask(page, shown) == 0, "no hint")


def test_panel_of_a_wide_page_is_folded_and_unfolded(page: ViserPage) -> None:
    expanded = "document.querySelector(Viser.PANEL_FOLD)?.ariaExpanded"
    for state in ("true", "false"):
        with part("PANEL_FOLD"):
            page.wait_until(lambda state=state: ask(page, expanded) == state, state)  # type: ignore[misc]
            ask(page, "document.querySelector(Viser.PANEL_FOLD).click()")
    page.wait_until(lambda: ask(page, expanded) == "true", "the panel")


@pytest.mark.long
def test_panel_of_a_narrow_page_is_found_and_folded(server: AppServer, open_page: OpenPage) -> None:
    page = open_page(server.url, nodes=NODES, window=PORTRAIT, script=script())
    count = "document.querySelectorAll(Viser.{}).length"
    with part("NARROW"):
        assert ask(page, "matchMedia(Viser.NARROW).matches")
    with part("PANEL"):
        assert ask(page, count.format("PANEL")) == 1
    with part("PANEL_HANDLE"):
        assert ask(page, count.format("PANEL_HANDLE")) == 1
        slider = page.frame.get_by_text("Height", exact=True)
        assert slider.is_visible()
    with part("PANEL_HANDLE"):
        tall = ask(page, "document.querySelector(Viser.PANEL).clientHeight")
        ask(page, "document.querySelector(Viser.PANEL_HANDLE).click()")
        page.wait_until(
            lambda: ask(page, "document.querySelector(Viser.PANEL).clientHeight") < tall / 2,
            "the panel to fold",
        )
    with part("PANEL_CONTENT"):
        assert ask(page, count.format("PANEL_CONTENT")) >= 1
    with part("PANEL_GROUND"):
        colour = """(() => {
            const panel = document.querySelector(Viser.PANEL);
            const before = getComputedStyle(panel).backgroundColor;
            panel.style.background = Viser.PANEL_GROUND;
            return [before, getComputedStyle(panel).backgroundColor];
        })()"""
        shown, ours = ask(page, colour)
        assert shown == ours != "rgba(0, 0, 0, 0)"
    page.page.set_viewport_size({"width": 1280, "height": 800})
    with part("NARROW"):
        page.wait_until(lambda: ask(page, count.format("PANEL")) == 0, "the docked panel")


@pytest.mark.long
def test_page_connects_again_only_with_the_focus(open_page: OpenPage) -> None:
    blurred = "document.hasFocus = () => false;"
    with AppServer(APP) as server, part("keepFocus"):
        left = open_page(server.url, nodes=NODES, script=script(blurred))
        focused = open_page(server.url, nodes=NODES, script=script(f"{blurred} Viser.keepFocus();"))
        server.kill()
        left.wait_lost()
        focused.wait_lost()
        server.start()
        focused.wait_ready(NODES)
        assert not left.connected


@pytest.mark.long
def test_page_needs_no_code_from_text(server: AppServer, open_page: OpenPage) -> None:
    with part("forgoCode"):
        page = open_page(server.url, nodes=NODES, script=script())
        refused = "(() => { try { Function('1'); } catch (error) { return error.name; } })()"
        assert ask(page, refused) == "EvalError"
        assert page.errors == []


@pytest.mark.long
def test_page_obeys_a_server_that_its_address_names(server: AppServer, open_page: OpenPage) -> None:
    with AppServer(APP) as other, part("websocket"):
        address = f"{other.url}/?websocket={server.url.replace('http', 'ws', 1)}"
        page = open_page(other.url, nodes=NODES, script=script())
        page.page.goto(address)
        page.wait_until(lambda: ask(page, "window.tapped?.address"), "its server")
        assert ask(page, "tapped.address") == server.url.replace("http", "ws", 1)


@pytest.mark.long
def test_page_plays_the_recording_that_its_address_names(
    server: AppServer, open_page: OpenPage
) -> None:
    with part("playbackPath"):
        page = open_page(server.url, nodes=NODES, script=script())
        requested: list[str] = []
        page.page.on("request", lambda request: requested.append(request.url))
        page.page.goto(f"{server.url}/?playbackPath=/run.viser")
        page.wait_until(
            lambda: f"{server.url}/run.viser" in requested, "the recording to be requested"
        )
