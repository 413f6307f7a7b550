"""The steps view of the sheet of programs: steps are edited in place, and the text follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from playwright.sync_api import Browser, Locator, Page

from katana450.extensions.programs.language.source import read
from katana450.extensions.programs.script.blocks import TextBlock, blocks_of
from katana450.extensions.programs.script.script import parse
from tests.browser.bare_page import ORIGIN, bare_page, module
from tests.browser.conftest import OpenPage
from tests.browser.finger import fingers, middle
from tests.browser.page import ViserPage
from tests.browser.server import AppServer
from tests.browser.session import MOVE, take
from tests.browser.sizes import PHONE, PORTRAIT
from tests.browser.teach_sheet import open_sheet, press, says
from tests.programs.test_script_schema import SCRIPTS

SCRIPT = """\
# A note on top.
frame: base
steps:
  - fill: 100
  # It may be gone.
  - grasp: cup      # from the front
  - repeat:
      times: 2
      steps:
        - wait: 1
        - nudge: {axis: 1, by: 20}

  - home
"""


def area(page: ViserPage) -> Locator:
    return page.page.locator("#teach-text")


def names(page: ViserPage) -> list[str]:
    return page.page.locator("#teach .steps .name").all_inner_texts()


def show(page: ViserPage, text: str) -> None:
    """Type a script into the text, and show its steps."""
    press(page, "Text")
    area(page).fill(text)
    press(page, "Steps")


def wait_text(page: ViserPage, text: str) -> None:
    page.wait_until(lambda: area(page).input_value() == text, "the text")


def open_block(page: ViserPage, title: str) -> None:
    page.page.locator("#teach .steps").get_by_role("button", name=title, exact=True).click()


EDITS = """async ([path, text, blocks]) => {
    const { duplicated, isOnly, moved, placesOf, removed, replaced, toggled } = await import(path);
    return blocks.flatMap((own, i) => {
        if (own.indent === null) return [];
        const { places } = placesOf(blocks, i);
        const list = places.map((place) => ({ name: "move", ...moved(text, own, place) }));
        list.push({ name: "copy", ...duplicated(text, own) });
        list.push({ name: "off", ...toggled(text, own) });
        if (!isOnly(blocks, i)) list.push({ name: "remove", ...removed(text, own) });
        for (const value of own.values.filter(({ before }) => !before))
            list.push({ name: "same", text: replaced(text, value, value.text), line: own.line });
        return list.map((edit) => ({ own: i, ...edit }));
    });
}"""
"""Returns all edits of all blocks."""


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["choose.yaml", "star.yaml", "boxes.yaml", "half.yaml"])
def test_edits_keep_every_other_line_and_the_structure(browser: Browser, name: str) -> None:
    text = SCRIPTS[name]

    def blocks(text: str) -> list[TextBlock]:
        return list(blocks_of(read(text), text))

    def edits(page: Page, text: str) -> list[dict[str, Any]]:
        own = msgspec.to_builtins(blocks(text))
        url = f"{ORIGIN}/static/teach/blocks.js"
        edits: list[dict[str, Any]] = page.evaluate(EDITS, [url, text, own])
        return edits

    before = blocks(text)
    with bare_page(browser) as page:
        for edit in edits(page, text):
            own, after = before[edit["own"]], edit["text"]
            size = own.last - own.first + 1
            if edit["name"] == "same":
                assert after == text
            elif edit["name"] == "move":
                # A list may be left empty, which the page refuses.
                lines = sorted(line.strip() for line in text.split("\n"))
                assert sorted(line.strip() for line in after.split("\n")) == lines
            elif edit["name"] == "copy":
                assert len(blocks(after)) > len(before)
                assert after.count("\n") == text.count("\n") + size
            elif edit["name"] == "remove":
                assert after.count("\n") == text.count("\n") - size
            else:
                same = [block.title for block in blocks(after) if block.line == own.line]
                assert same[0].removesuffix(" …")[:9] == own.title[:9]
                back = [e for e in edits(page, after) if e["name"] == "off"]
                assert text in [other["text"] for other in back]
                continue
            moved = [block for block in blocks(after) if block.line == edit["line"]]
            if edit["name"] != "remove" and moved:
                assert moved[0].title.split()[-1] == own.title.split()[-1]


def test_words_for_a_value_have_quotes_where_yaml_needs_them(browser: Browser) -> None:
    with bare_page(browser) as page:
        for text, i, words, changed in (
            ("- grasp: 𝄞 cup # it", 0, "a: b", '- grasp: "a: b" # it'),
            ("- grasp: 'a b' # it", 0, "c", '- grasp: "c" # it'),
            ("- wait: 1", 0, "2 * t", "- wait: 2 * t"),
            ("- wait:", 0, "2", "- wait: 2"),
            ("- grasp: a", 0, "no", '- grasp: "no"'),
            # The last ones are values that the step does not have yet.
            ("- grasp: 'a, b' # it", -1, "40", '- grasp: {object: "a, b", height: 40} # it'),
            ("- pour: {into: basin}", -1, "2", "- pour: {into: basin, shake: 2}"),
            ("- via:\n    through: [up]", -1, "0.5", "- via:\n    blend: 0.5\n    through: [up]"),
            (
                "- line:\n    by: {z: 1}\n    feed: 9",
                -2,
                "3",
                "- line:\n    by: {z: 1}\n    feed: 9\n    yaw: 3",
            ),
        ):
            (block,) = blocks_of(read(f"steps:\n{text}"), f"steps:\n{text}")
            own = [f"steps:\n{text}", msgspec.to_builtins(block.values[i]), words]
            edit = "({ replaced }, own) => replaced(...own)"
            assert module(page, "teach/blocks.js", edit, own) == f"steps:\n{changed}"


@pytest.fixture
def sheet(new_page: ViserPage) -> ViserPage:
    """Return a new window of the driver with the sheet of programs open."""
    open_sheet(new_page)
    return new_page


def test_steps_are_edited_and_undone_and_the_text_follows(sheet: ViserPage) -> None:
    show(sheet, SCRIPT)
    titles = ["fill 100", "grasp cup", "repeat times 2", "wait 1", "nudge axis 1, by 20", "home"]
    sheet.wait_until(lambda: names(sheet) == titles, "the steps")
    open_block(sheet, "grasp cup")
    press(sheet, "Move up: grasp cup")
    grasp = "  # It may be gone.\n  - grasp: cup      # from the front\n"
    first = SCRIPT.replace(grasp, "").replace("  - fill", f"{grasp}  - fill")
    wait_text(sheet, first)
    up = sheet.page.get_by_role("button", name="Move up: grasp cup")
    sheet.wait_until(lambda: up.get_attribute("aria-disabled") == "true", "the end of the list")
    assert up.evaluate("each => each.matches(':focus')")
    # Two presses before the server has read the text between them.
    down = sheet.page.get_by_role("button", name="Move down: grasp cup")
    down.evaluate("each => { each.click(); each.click(); }")
    inner = "".join(f"      {line}\n" for line in grasp.splitlines())
    wait_text(sheet, SCRIPT.replace(grasp, "").replace("        - wait", f"{inner}        - wait"))
    for _ in range(3):
        press(sheet, "Undo in Programs")
    wait_text(sheet, SCRIPT)
    sheet.wait_until(lambda: names(sheet) == titles, "the steps")

    open_block(sheet, "grasp cup")
    press(sheet, "Disable: grasp cup")
    disabled = SCRIPT.replace("  - grasp", "  # - grasp")
    wait_text(sheet, disabled)
    row = sheet.page.locator("#teach .steps li.off")
    sheet.wait_until(lambda: row.count() == 1, "the disabled step")
    press(sheet, "Enable: grasp cup")
    wait_text(sheet, SCRIPT)
    press(sheet, "Duplicate: grasp cup")
    wait_text(sheet, SCRIPT.replace(grasp, grasp * 2))
    press(sheet, "Remove: grasp cup")
    wait_text(sheet, SCRIPT)
    sheet.wait_until(lambda: names(sheet) == titles, "the steps")
    open_block(sheet, "home")
    press(sheet, "Insert after: home")
    sheet.page.get_by_role("group", name="Insert after: home").get_by_text("repeat").click()
    added = "  - repeat:\n      times: 2\n      steps:\n        - wait: 1\n"
    wait_text(sheet, SCRIPT + added)
    press(sheet, "Insert after: repeat times 2")
    sheet.page.get_by_role("button", name="present pose").click()
    sheet.wait_until(lambda: "\n  - joints: [0, " in area(sheet).input_value(), "the pose")
    parse(area(sheet).input_value())
    # The text goes the other way.
    show(sheet, "steps:\n  - home\n")
    sheet.wait_until(lambda: names(sheet) == ["home"], "the step")
    open_block(sheet, "home")
    remove = sheet.page.get_by_role("button", name="Remove: home")
    assert remove.get_attribute("aria-disabled") == "true"
    assert "needs one step" in (remove.get_attribute("title") or "")
    assert sheet.errors == []


def test_value_is_changed_in_its_field_and_a_mistake_is_shown_there(sheet: ViserPage) -> None:
    show(sheet, SCRIPT)
    open_block(sheet, "nudge axis 1, by 20")
    value = sheet.page.locator("#teach .values input").nth(1)
    value.fill("900,5")
    value.press("Enter")
    wait_text(sheet, SCRIPT.replace("by: 20", "by: 900.5"))
    # A text has the name, which the field shows and changes.
    name = sheet.page.get_by_label("Name", exact=True)
    name.fill("Turn it")
    name.press("Enter")
    wait_text(sheet, 'name: "Turn it"\n' + SCRIPT.replace("by: 20", "by: 900.5"))
    press(sheet, "Undo in Programs")
    sheet.page.locator("#teach .values em", has_text="not between -720 and 720").wait_for()
    press(sheet, "Undo in Programs")
    sheet.wait_until(lambda: value.input_value() == "20", "the value")


@pytest.mark.long
@pytest.mark.parametrize("touch", [False, True])
def test_step_is_dragged_into_a_block(sheet: ViserPage, touch: bool) -> None:
    show(sheet, SCRIPT)
    rows = sheet.page.locator("#teach .steps li")
    sheet.wait_until(lambda: rows.count() == 6, "the steps")
    if touch:
        grip, over = rows.nth(5).locator("b"), rows.nth(3).bounding_box()
        assert over is not None
        with fingers(sheet.page) as hand:
            hand.put(middle(grip))
            hand.move((over["x"] + 20.0, over["y"] + 2.0))
            hand.lift()
    else:
        rows.nth(5).locator("b").drag_to(rows.nth(3), target_position={"x": 60, "y": 2})
    home = "        - home\n        - wait"
    wait_text(sheet, SCRIPT.replace("\n  - home", "").replace("        - wait", home))


@pytest.mark.long
def test_mistakes_mark_their_steps_and_lead_to_their_lines(sheet: ViserPage) -> None:
    wrong = SCRIPT.replace("fill", "fil").replace("by: 20", "by: far")
    show(sheet, wrong)
    problems = sheet.page.locator("#teach-problems button")
    sheet.wait_until(lambda: problems.count() == 2, "the problems")
    marked = sheet.page.locator("#teach .steps .wrong .name")
    sheet.wait_until(lambda: marked.all_inner_texts() == ["fil 100", "nudge axis 1, by far"], "it")
    press(sheet, "Preview")
    sheet.wait_until(lambda: "not previewed" in says(sheet), "what is not done")
    assert problems.nth(1).inner_text().startswith("Step 4, line 11: nudge axis 1, by far\n")
    # The list shows the step and its field, the text the line.
    problems.nth(1).click()
    assert sheet.page.get_by_role("button", name="Remove: nudge axis 1, by far").is_visible()
    assert sheet.page.locator(":focus").get_attribute("aria-invalid") == "true"
    press(sheet, "Text")
    selected = "(each) => each.value.slice(each.selectionStart, each.selectionEnd)"
    assert area(sheet).evaluate(selected) == "        - nudge: {axis: 1, by: far}"
    # Of a text that is no YAML the last steps are shown, and where to mend it.
    show(sheet, wrong.replace("{axis", "axis"))
    sheet.wait_until(lambda: sheet.page.locator(".steps.lost").count() == 1, "the old steps")
    assert problems.count() == 1
    assert len(names(sheet)) == 6
    problems.click()
    assert area(sheet).is_visible()


@pytest.mark.long
def test_first_step_is_inserted_on_a_phone(
    server: AppServer, open_page: OpenPage, artefacts: Path
) -> None:
    page = open_page(server.url, nodes=("/arm", MOVE), window=PORTRAIT, own_camera=True, **PHONE)
    take(page)
    open_sheet(page)
    press(page, "Steps")
    page.page.get_by_role("group", name="Insert the first step").get_by_text("home").click()
    wait_text(page, 'name: "My script"\nsteps:\n  - home\n')
    page.wait_until(lambda: names(page) == ["home"], "the step")
    page.keep(artefacts / "blocks-phone.png")
    sizes = page.page.locator("#teach .edit button:visible, #teach .steps .name").evaluate_all(
        "all => all.map((each) => [each.offsetWidth, each.offsetHeight])"
    )
    assert all(width >= 44 and height >= 44 for width, height in sizes), sizes
    assert "home" in says(page)
    assert page.errors == []
