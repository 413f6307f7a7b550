"""Scripts of the page, each in a document of its own: what they compute, keep and send."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.teach import TaughtPose, taught
from katana450.extensions.recording.files.spans import Span, at_place
from tests.browser.bare_page import bare_page, load, module


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    with bare_page(browser) as page:
        yield page


# Words


def test_times_are_those_of_the_browser_and_oneself_is_you(browser: Browser) -> None:
    with bare_page(browser, locale="en-GB", timezone_id="America/New_York") as page:
        named = "({ named }, words) => named(words, [])"
        words = "Started by Anna at 2026-11-29T14:43:27+00:00. Axis 2 is at its limit."
        said = module(page, "page/words.js", named, words)
        assert said == "Started by Anna at 09:43. Axis 2 is at its limit."
        addressed = "({ addressed }, words) => addressed(words, 'Anna')"
        for words, expected in (
            ("Anna drives", "You drive"),
            ("Anna pressed STOP.", "You pressed STOP."),
            ("Annabel drives", "Annabel drives"),
        ):
            assert module(page, "page/words.js", addressed, words) == expected


# First frame

CONTEXTS = """({ FirstFrame }, draws) => {
    let contexts = 0;
    const later = [];
    window.setTimeout = (act) => later.push(act);
    HTMLCanvasElement.prototype.getContext = () => ++contexts;
    const frame = new FirstFrame();
    if (draws) frame.note();
    for (const act of later) act();
    return contexts;
}"""
"""Returns the number of contexts for drawing that the page makes to see whether it can draw."""


def test_page_that_has_drawn_makes_no_context_to_see_whether_it_can(page: Page) -> None:
    path = "page/first_frame.js"
    assert [module(page, path, CONTEXTS, draws) for draws in (True, False)] == [0, 1]


# Knobs


def test_value_that_came_late_is_sent_again_while_the_hand_holds_the_knob(page: Page) -> None:
    load(page, "Knobs", "instruments/knob.js")
    load(page, "Commands", "instruments/command.js")
    assert page.evaluate(
        """async () => {
            const said = [];
            const request = (value) => ({ do: "joint", value });
            const command = new Commands.Command("k", request, (act) => said.push(act));
            const options = { title: "Axis 1", low: -90, high: 90, step: 1, full: 1, text: String };
            const knob = new Knobs.Knob({ ...options, command });
            document.body.replaceChildren(knob.element);
            Object.assign(knob.dial.style, { width: "100px", height: "100px" });
            knob.dial.setPointerCapture = () => {};
            const point = (type, clientX, clientY) =>
                knob.dial.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX, clientY }));
            const sent = async (count) => {
                while (said.length < count) await new Promise((later) => setTimeout(later, 5));
            };
            const { left, top } = knob.dial.getBoundingClientRect();
            const refusal = { is: "refused", id: "k", retry: 0.01 };
            knob.take({ revocations: 7, ticket: 0 }, 0, 0);
            point("pointerdown", left + 50, top);
            point("pointermove", left + 100, top + 50);
            await sent(1);
            knob.answered(refusal);
            await sent(2);
            point("pointerup", left + 100, top + 50);
            knob.answered(refusal);
            knob.take({ revocations: 8, ticket: 0 }, 0, 0);
            await new Promise((later) => setTimeout(later, 60));
            const acts = said.map(({ value, revocations }) => [value, revocations]);
            return [acts, knob.dial.ariaValueNow];
        }"""
    ) == [[[90, 7], [90, 7]], "0.00"]


# Objects

BOX = {
    **{"name": "box 1", "shape": "box", "size": [0.03, 0.03, 0.05], "scale": 1.0, "opacity": 1.0},
    "T": [[1.0, 0.0, 0.0, 0.3], [0.0, 1.0, 0.0, 0.1], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
    **{"hidden": False, "held": False, "fixed": True, "zone": "none"},
}


def test_place_of_an_object_is_typed_by_who_drives(page: Page) -> None:
    page.route("**/api/v1/objects", lambda route: route.fulfill(json={"objects": [BOX]}))
    load(page, "Sheet", "objects/object.js")
    page.evaluate(
        """() => {
            const live = { role: "operator", mine: true, own_program: false, holder: "Ada" };
            const store = { live, object: "", follow: (act) => (window.follow = act) };
            store.select = (name) => {
                store.object = name;
                window.dispatchEvent(new Event("selected"));
            };
            const [say, toast] = [(request) => said.push(request), (words) => told.push(words)];
            Object.assign(window, { said: [], told: [], live });
            new Sheet.ObjectForm({ store, say, toast }).watch(true);
            document.getElementById("objects").hidden = false;
        }"""
    )
    form = page.locator("#object")
    x = form.get_by_label("x", exact=True)
    expect(x).to_have_value("300")
    expect(form.get_by_role("button", name="Hand", pressed=True)).to_be_visible()
    expect(form).to_contain_text("attached to the hand")
    x.fill("412.5")
    x.press("Enter")
    page.wait_for_function("said.length === 1")
    assert page.evaluate("said[0].T.map((row) => row[3])") == [0.4125, 0.1, 0.0, 1.0]
    # The server has refused it, as the next reading shows.
    expect(x).to_have_value("300")
    x.fill("")
    x.press("Enter")
    page.wait_for_function("told.length === 1")
    assert page.evaluate("told") == ["x needs a number."]
    assert page.evaluate("said.length") == 1
    turns, names = [0.0, 1.0, 0.0], ["Turn, °", "Colour", "Opacity"]
    for count, (name, value) in enumerate(zip(names, ("90", "#ff8800", "40"), strict=True), 2):
        form.get_by_label(name).fill(value)
        form.get_by_label(name).press("Enter")
        page.wait_for_function(f"said.length === {count}")
    assert page.evaluate("said[1].T.slice(0, 3).map((row) => row[0])") == pytest.approx(turns)
    assert page.evaluate("[said[2].colour, said[3].opacity]") == ["#ff8800", 0.4]
    # Another person drives.
    page.evaluate("live.mine = false, follow()")
    refusal = page.locator("#objects .refusal")
    assert refusal.inner_text() == "Ada drives. Request the arm at the top to change objects."
    assert page.locator("#add-box").is_disabled()
    assert x.is_disabled()
    page.evaluate("live.mine = true, follow()")
    assert page.locator("#add-box").is_enabled()
    assert not refusal.is_visible()


# Pause and Speed


def test_pause_goes_to_whatever_moves_and_one_press_counts_once(page: Page) -> None:
    load(page, "Pace", "pace.js")
    page.evaluate(
        """() => {
            Object.assign(window, { said: [], told: [] });
            const [say, toast] = [(each) => said.push(each), (words) => told.push(words)];
            Pace.begin({ say, toast });
        }"""
    )

    def press(**status: Any) -> Any:
        """Show a status and press; return what was said since."""
        shown: dict[str, Any] = {
            "pace": "",
            "stopped": None,
            "paused": False,
            "orders": [],
            "speed": 1.0,
        }
        return page.evaluate(
            """(status) => {
                Pace.draw(status);
                document.getElementById("pause").click();
                return said.splice(0);
            }""",
            shown | status,
        )

    assert press() == [{"do": "pause"}]
    assert press(orders=["end"]) == [{"do": "steer", "order": "pause"}]
    # A press just after the button changed may have meant Pause.
    assert press(orders=["end"], paused=True) == []
    page.wait_for_timeout(200)
    assert press(paused=True) == []
    page.evaluate(
        "() => { const now = performance.now; performance.now = () => now.call(performance) + 500 }"
    )
    assert press(orders=["end"], paused=True) == [{"do": "steer", "order": "resume"}]
    assert press(pace="Anna drives: ask for the arm.") == []
    assert page.evaluate("told") == ["Anna drives: ask for the arm."]
    assert page.locator("#speed input").is_disabled()
    press()
    page.locator("#speed input").fill("30")
    assert page.evaluate("said") == [{"do": "speed", "value": 0.3}]
    # The status of before does not take the slider back.
    press(speed=1.0)
    assert page.locator("#speed input").input_value() == "30"


# Jog

DEVICES = """() => {
    Object.assign(window, { said: [], stops: 0 });
    window.pad = { connected: true, axes: [0, 0, 0, 0],
        buttons: Array.from({ length: 17 }, () => ({ pressed: false })) };
    navigator.getGamepads = () => [window.pad];
    window.device = Object.assign(new EventTarget(), {
        opened: true, productName: "Synthetic SpaceMouse",
        report(reportId, data) {
            device.dispatchEvent(Object.assign(new Event("inputreport"), { reportId, data }));
        },
        push(x) {
            const data = new DataView(new ArrayBuffer(6));
            data.setInt16(0, x, true);
            device.report(1, data);
        },
    });
    const hid = { getDevices: async () => [device] };
    Object.defineProperty(navigator, "hid", { value: hid });
}"""
"""Script that gives the browser a gamepad and a SpaceMouse; x of the latter is to the right."""

BEGIN = """() => {
    const say = ({ rates, by }) => said.push(rates ?? by);
    Jog.begin({ say, stop: () => { stops += 1; Jog.quiet(); } });
    Jog.show(true);
}"""

HELD = "() => { window.held = setInterval(() => device.push(-350), 16) }"


@pytest.fixture
def jog(page: Page) -> Page:
    """Return a document with the Jog sheet open, which notes the rates that are sent."""
    page.evaluate(DEVICES)
    load(page, "Jog", "jog.js")
    page.evaluate(BEGIN)
    return page


def moves(page: Page, axis: int, sign: int) -> None:
    """Wait until rates along ``axis`` (0 to 4) alone are sent, with the sign."""
    page.wait_for_function(
        """([axis, sign]) => {
            const rates = said.at(-1) ?? [];
            return sign * rates[axis] > 0 && rates.every((rate, i) => i === axis || !rate);
        }""",
        arg=[axis, sign],
    )


def rests(page: Page) -> None:
    """Wait until rates of zero are sent, and check that they are the last ones."""
    page.wait_for_function("() => said.at(-1)?.every((rate) => rate === 0)")
    count = page.evaluate("said.length")
    page.wait_for_timeout(120)
    assert page.evaluate("said.length") == count


def key(page: Page, kind: str, code: str, *, repeat: bool = False, **more: bool) -> None:
    event = {"type": f"key{kind}", "code": code, "repeat": repeat, **more}
    call = "(event) => event.type === 'keyup' ? Jog.release(event.code) : Jog.key(event)"
    page.evaluate(call, event)


def test_held_key_moves_along_one_axis_until_its_release(jog: Page) -> None:
    for code, axis, sign in (("KeyW", 0, 1), ("KeyS", 0, -1), ("KeyD", 1, -1), ("KeyR", 2, 1)):
        key(jog, "down", code)
        moves(jog, axis, sign)
        key(jog, "up", code)
        rests(jog)
    # A shortcut of the browser ends everything.
    key(jog, "down", "KeyW")
    moves(jog, 0, 1)
    key(jog, "down", "ControlLeft", ctrlKey=True)
    rests(jog)


def test_key_held_at_a_stop_counts_again_after_its_release(jog: Page) -> None:
    key(jog, "down", "KeyA")
    moves(jog, 1, 1)
    jog.evaluate("Jog.quiet()")
    # The browser repeats a held key.
    key(jog, "down", "KeyA", repeat=True)
    rests(jog)
    key(jog, "up", "KeyA")
    key(jog, "down", "KeyA")
    moves(jog, 1, 1)


def test_yaw_that_the_arm_does_not_have_is_not_sent(jog: Page) -> None:
    key(jog, "down", "KeyQ")
    jog.wait_for_timeout(120)
    assert jog.evaluate("said") == []


def test_gamepad_counts_with_its_shoulder_button_and_stops_without(jog: Page) -> None:
    jog.evaluate("() => { pad.axes[0] = -1 }")
    jog.locator("#gamepad", has_text="hold LB or RB").wait_for(state="attached")
    assert jog.evaluate("said") == []
    jog.evaluate("() => { pad.buttons[4].pressed = true }")
    moves(jog, 1, 1)
    # It is unplugged while its stick is deflected.
    jog.evaluate("() => { navigator.getGamepads = () => [] }")
    rests(jog)
    jog.evaluate("() => { navigator.getGamepads = () => [pad]; pad.buttons[1].pressed = true }")
    jog.wait_for_function("() => stops === 1")
    # What was held at the stop moves nothing.
    rests(jog)
    jog.evaluate("() => { for (const each of pad.buttons) each.pressed = false }")
    jog.wait_for_timeout(100)
    jog.evaluate("() => { pad.buttons[5].pressed = true }")
    moves(jog, 1, 1)
    jog.evaluate("() => { Jog.show(false); pad.buttons[1].pressed = true }")
    jog.wait_for_function("() => stops === 2")
    rests(jog)


def test_spacemouse_moves_while_it_reports_and_not_over_a_stop(jog: Page) -> None:
    jog.locator("#spacemouse", has_text="Synthetic SpaceMouse").wait_for(state="attached")
    jog.evaluate(HELD)
    moves(jog, 1, 1)
    # The cable is unplugged, so no report announces the release.
    jog.evaluate("() => clearInterval(held)")
    rests(jog)
    jog.evaluate(HELD)
    moves(jog, 1, 1)
    jog.evaluate("() => device.report(3, new DataView(Uint8Array.of(1, 0).buffer))")
    assert jog.evaluate("stops") == 1
    # The cap stays pushed when the stop is cleared.
    rests(jog)
    jog.evaluate("() => { clearInterval(held); device.push(0) }")
    jog.evaluate(HELD)
    moves(jog, 1, 1)
    jog.evaluate("() => clearInterval(held)")


ARM = {
    "gripper": [-0.4, 0.3],
    "freedoms": 5,
    "joints": ["pan", "lift"],
    "links": [{"label": "1 base turn"}, {"label": "2 shoulder"}],
    "slides": [False, True],
}


def test_steps_move_once_by_button_and_key(browser: Browser) -> None:
    with bare_page(browser, arm=ARM) as page:
        page.evaluate(DEVICES)
        page.evaluate(
            """async (path) => {
                const { Steps } = await import(path);
                const sheet = document.getElementById("jog");
                sheet.hidden = false;
                window.steps = await Steps.in(sheet, (request) => said.push(request));
            }""",
            "http://page.test/static/jog/steps.js",
        )

        def said() -> Any:
            return page.evaluate("said.splice(0)")

        def choose(name: str, value: str) -> None:
            page.locator(f"#jog [name={name}][value='{value}'] + span").click()

        for code, angle in (("KeyO", 0.3), ("KeyC", -0.4)):
            page.evaluate("(code) => steps.key({ type: 'keydown', code }, {})", code)
            assert said() == [{"do": "gripper", "angle": angle}]
        page.locator("#gripper button", has_text="Open").click()
        assert said() == [{"do": "gripper", "angle": 0.3}]
        press = """([code, repeat]) => steps.key(
            { type: "keydown", code, repeat }, { KeyS: [0, -1] })"""
        assert page.evaluate(press, ["KeyS", False]) is False, "without a step it is held"
        choose("step", "1")
        assert not page.locator("#pads").is_visible()
        for repeat in (False, True, True):
            assert page.evaluate(press, ["KeyS", repeat])
        assert said() == [{"do": "step_tool", "by": [-0.001, 0, 0, 0, 0], "frame": "base"}]
        choose("step", "10")
        page.get_by_role("button", name="z minus 10 mm").click()
        assert said()[0]["by"] == [0, 0, -0.01, 0, 0]
        # Joints move by steps only.
        choose("step", "0")
        choose("frame", "joints")
        page.get_by_role("button", name="1 base turn plus 1 °").click()
        page.get_by_role("button", name="2 shoulder minus 1 mm").click()
        turn, slide = said()
        assert (turn["axis"], slide["axis"], slide["by"]) == (1, 2, -0.001)
        assert turn["by"] == pytest.approx(0.0174533, abs=1e-6)
        for buttons in ([True, False], [True, False], [False, True]):
            page.evaluate("(buttons) => steps.grip(...buttons)", buttons)
        assert [message["angle"] for message in said()] == [0.3, -0.4]


def test_elbow_of_seven_axes_moves_while_the_tool_rests(browser: Browser) -> None:
    with bare_page(browser, arm={**ARM, "freedoms": 6, "turns_elbow": True}) as page:
        page.evaluate(DEVICES)
        load(page, "Jog", "jog.js")
        page.evaluate(BEGIN)
        page.evaluate("document.getElementById('jog').hidden = false")
        page.locator("[data-hold=KeyH]").wait_for()
        key(page, "down", "KeyH")
        moves(page, 6, 1)
        # With a motion of the tool the elbow waits.
        key(page, "down", "KeyW")
        moves(page, 0, 1)
        key(page, "up", "KeyW")
        key(page, "up", "KeyH")
        rests(page)
        # With six freedoms the tool also turns about the vertical.
        key(page, "down", "KeyQ")
        moves(page, 5, 1)
        key(page, "up", "KeyQ")
        rests(page)
        page.evaluate("() => { pad.buttons[4].pressed = pad.buttons[6].pressed = true }")
        moves(page, 6, -1)
        page.evaluate("() => { pad.buttons[4].pressed = pad.buttons[6].pressed = false }")
        rests(page)
        page.locator("#jog [name=step][value='10'] + span").click()
        page.get_by_role("button", name="Elbow minus 10 °").click()
        assert page.evaluate("said.at(-1)") == pytest.approx(-0.174533, abs=1e-6)


# Undo


def test_undo_names_the_stops_that_the_page_knows(page: Page) -> None:
    requests = module(
        page,
        "edit.js",
        """({ begin, key }) => {
            const [said, scene] = [[], document.createElement("iframe")];
            const store = { follow() {} };
            begin({ store, scene, toast() {}, say: (each) => said.push(each) }, {});
            for (const revocations of [7, 8]) {
                store.live = { undo: ["arm (drag)"], revocations };
                const pressed = { code: "KeyZ", key: "z", ctrlKey: true, target: document.body };
                key({ type: "keydown", ...pressed });
            }
            return said;
        }""",
    )
    assert requests == [{"do": "undo", "revocations": n, "id": "undo"} for n in (7, 8)]


# Teach


def pose(**fields: Any) -> dict[str, Any]:
    plain = {"gripper": None, "grips": False, "wait": 0, "speed": 100, "blend": False}
    return {"joints": [10.0, -68.25, 85.0, 8.125, -0.5], **plain, **fields}


TAUGHT = {
    "plain": (1, [pose(), pose(joints=[0.0] * 5)]),
    "loop": (7, [pose(speed=30, wait=0.5), pose(gripper=-12.5, grips=True, wait=1)]),
    "speeds": (3, [pose(speed=55), pose(speed=55, grips=True, gripper=3), pose()]),
    "blend": (2, [pose(blend=True), pose(blend=True), pose(), pose(blend=True)]),
    'a "name": # \\': (1, [pose(blend=True, speed=50), pose(speed=20)]),
}


def test_text_of_poses_is_read_back_as_the_same_poses(page: Page) -> None:
    """The page writes scripts and the server reads them: nothing is lost on the way."""
    for name, (times, poses) in TAUGHT.items():
        content = {"name": name, "times": times, "poses": poses}
        text = module(page, "teach/poses.js", "({ scriptOf }, all) => scriptOf(all).text", content)
        program = taught(parse(text))
        assert program is not None, text
        assert (program.name, program.times) == (name, times)
        wanted = []
        for number, pose in enumerate(poses):
            after = poses[number + 1] if number + 1 < len(poses) else None
            # A pose is passed only on the way to another one at the same speed.
            blend = pose["blend"] and after is not None and after["speed"] == pose["speed"]
            speed, joints = pose["speed"] / 100, tuple(pose["joints"])
            wanted.append(TaughtPose(joints, speed, blend, pose["gripper"], pose["wait"]))
        assert list(program.poses) == wanted, text


def test_pose_with_something_in_the_hand_keeps_the_fingers_closed(page: Page) -> None:
    act = (
        "({ fingersOf }, held) => fingersOf({ gripper_goal: 0.2, held }, { gripper: [-0.4, 0.3] })"
    )
    angles = [module(page, "teach/poses.js", act, held) for held in (None, "cup")]
    assert angles == pytest.approx([11.459, -22.918], abs=1e-3)


KEPT = """({ Content }, text, joints) => {
    const arm = { name: "arm", joints: new Array(joints).fill("") };
    const kept = { getItem: (key) => key === "katana450.teach arm" ? text : null };
    const content = new Content(kept, arm);
    return [content.broken, content.now.name];
}"""


MINE = '{"format": 1, "name": "Mine", "times": 1, "poses": [], "text": null}'

CONTENTS = (
    (MINE, 5, False, "Mine"),
    ('{"format": 1, "name": "x", "times": 1, "poses": [{}]}', 5, True, "My script"),
    ("{", 5, True, "My script"),
    ("null", 5, True, "My script"),
    ('{"format": 1}', 5, True, "My script"),
)
"""What the browser keeps, the joints of the arm, whether it is broken, and the name of the list."""


def test_broken_content_of_the_browser_is_refused(page: Page) -> None:
    for text, joints, broken, name in CONTENTS:
        shown = module(page, "teach/content.js", KEPT, text, joints)
        assert shown == [broken, name], (text, joints)


CHANGED = """({ Content }) => {
    const kept = { getItem: () => null, setItem() {} };
    const content = new Content(kept, { name: "arm", joints: new Array(5).fill("") }, () => {});
    const names = [];
    const act = (name, ...values) => (content[name](...values), names.push(content.now.name));
    act("change", { name: "one" });
    act("change", { name: "two" });
    act("undo");
    act("redo");
    act("undo");
    act("change", { name: "three" });
    // A change takes the place of what could be done again.
    act("redo");
    for (let i = 0; i < 3; i++) act("undo");
    return [names, content.past.length > 0, content.future.length > 0];
}"""
"""Changes the name of a list; returns the name after each change, and what is still possible."""


def test_changes_of_taught_poses_are_undone_and_done_again(page: Page) -> None:
    names, undoable, redoable = module(page, "teach/content.js", CHANGED)
    wanted = ["one", "two", "one", "two", "one", "three", "three", "one", "My script", "My script"]
    assert names == wanted
    assert (undoable, redoable) == (False, True)


# Timeline


def test_axis_of_the_timeline_is_that_of_the_server(page: Page) -> None:
    spans = [Span(10.0, 12.0), Span(20.0, 25.0), Span(40.0, 41.5)]
    places = [-1.0, 0.0, 1.5, 2.0, 2.5, 7.0, 7.5, 9.0]
    times = [9.0, 10.0, 11.5, 15.0, 20.0, 23.0, 30.0, 41.5, 50.0]

    def place_of(spans: Sequence[Span], t: float) -> float:
        return sum(min(max(t - span.start, 0.0), span.length) for span in spans)

    for function, ours, values in (("atPlace", at_place, places), ("placeOf", place_of, times)):
        call = f"(axis, spans, values) => values.map((each) => axis.{function}(spans, each))"
        shown = module(page, "timeline/axis.js", call, spans, values)
        assert shown == pytest.approx([ours(spans, value) for value in values]), function
