"""The bench in headless Chromium: by mouse, keys and typing, in two windows, without a server."""

import io
import json
import runpy
import tomllib
import warnings
import zipfile
from pathlib import Path

import pytest

import vcc
from tests.bench.browser import AXE, Page
from vcc.bench.document import Document
from vcc.prescriptions import built_in_lenses


def test_sensor_is_dragged_and_picture_follows_and_undo_takes_it_back(page):
    before = page.picture()
    x, y = page.middle("sensor")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x - 40, y, steps=4)
    page.drawn()
    dragged = page.place("sensor")
    assert 44 < float(dragged.removesuffix(" mm")) < 50
    page.page.mouse.up()
    page.settle()
    assert page.place("sensor") == dragged
    assert page.picture() != before
    page.page.keyboard.press("Control+z")
    page.wait_for_place("sensor", "52 mm")
    page.settle()
    page.until(page.button("Undo").is_disabled, True)  # all of the drag was one step
    page.page.keyboard.press("Control+Shift+z")
    page.wait_for_place("sensor", dragged)


def test_of_a_hundred_moves_at_once_four_are_sent_and_after_a_state_the_last(page):
    sent = page.page.evaluate(
        """() => {
            const { bench } = document.querySelector("vcc-bench");
            const before = bench.turn;
            for (let number = 1; number <= 100; number++)
                bench.set(["sensor", "z"], `${52 + number / 100} mm`, true);
            return [before, bench.turn];
        }"""
    )
    assert sent[1] == sent[0] + 4
    page.wait_for_place("sensor", "53 mm")
    page.page.wait_for_function(
        "turn => document.querySelector('vcc-bench').bench.picture.about.turn >= turn", arg=sent[1] + 1
    )
    # and one more that says that the hand rests
    assert page.page.evaluate("document.querySelector('vcc-bench').bench.turn") <= sent[1] + 2


def test_what_is_too_large_to_be_sent_is_named_and_the_bench_goes_on(page):
    words = page.page.evaluate(
        """() => {
            const { bench } = document.querySelector("vcc-bench");
            const where = ["elements", 0, "pattern"];
            bench.act({ do: "upload", where, name: "leaf.png" }, [new ArrayBuffer(33.5 * 2 ** 20)]);
            const upload = bench.refused[0].words;
            bench.act({ do: "hello", document: { camera: "x".repeat(2 ** 25) } });
            return [upload, bench.refused[0].words];
        }"""
    )
    assert "leaf.png has 33.5 MiB, and a bench takes up to 32 MiB" in words[0]
    assert "The camera of this page has 32.0 MiB" in words[1]
    page.settle()
    page.until(page.page.locator(".toast.error").count, 1)
    # The connection stands: the server answers what follows, and has the camera of before.
    assert page.page.evaluate("document.querySelector('vcc-bench').bench.open")
    page.page.evaluate("document.querySelector('vcc-bench').bench.set(['sensor', 'z'], '51 mm')")
    page.wait_for_place("sensor", "51 mm")
    page.settle()


def test_drag_is_pulled_to_where_the_scene_is_sharp(page):
    x, y = page.middle("sensor")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    places = set()
    for step in range(2, 40, 2):
        page.page.mouse.move(x + step, y)
        places.add(page.pulled("sensor"))
    page.page.mouse.up()
    # f = 50 mm: the scene's nearest leaves, 0.8 m away, are sharp 53.33 mm behind the lens
    assert ("53.3333 mm", "nearest of the scene, 800 mm, is sharp") in places


def test_lens_is_pulled_to_where_the_sensor_as_it_stands_sees_the_scene_sharp(page):
    x, y = page.middle("0")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    places = set()
    for step in range(1, 16):
        page.page.mouse.move(x + step, y)
        places.add(page.pulled("0"))
    page.page.mouse.up()
    # T = 3.052 m from the town to the sensor: by Bessel the lens stands (T + √(T² − 4·f·T))/2 − 3 m behind z = 0
    assert ("1.15287 mm", "farthest of the scene, 3 m, is sharp") in places


def test_arrow_keys_step_and_those_that_follow_one_another_are_one_movement(page):
    page.part("sensor").focus()
    for key, place in (
        ("ArrowRight", "52.1 mm"),
        ("Shift+ArrowRight", "53.1 mm"),
        ("Alt+ArrowLeft", "53.09 mm"),
        ("ArrowLeft", "52.99 mm"),
    ):
        page.page.keyboard.press(key)
        page.wait_for_place("sensor", place)
    page.after(700)  # longer than the pause that ends a movement
    page.part("sensor").evaluate(
        "part => { for (let n = 0; n < 3; n++)"
        " part.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true })) }"
    )
    page.wait_for_place("sensor", "53.29 mm")
    page.after(700)
    page.settle()
    page.button("Undo").click()
    page.wait_for_place("sensor", "52.99 mm")


def test_arrow_keys_in_a_field_are_one_movement_and_escape_takes_it_back(page):
    field = page.page.locator("#sensor-z")
    # Between two keys the field is drawn again; they take 0.8 s in all, and a pause is 0.5 s.
    field.evaluate(
        """async (field) => {
            for (const held of [{}, {}, { shiftKey: true }, { altKey: true }]) {
                field.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowUp", ...held }));
                await new Promise((later) => setTimeout(later, 200));
            }
            await new Promise((later) => setTimeout(later, 600));
        }"""
    )
    page.wait_for_place("sensor", "64.1 mm")
    page.settle()
    page.button("Undo").click()
    page.wait_for_place("sensor", "52 mm")
    field.press("ArrowUp")
    page.wait_for_place("sensor", "53 mm")
    field.press("Escape")
    page.wait_for_place("sensor", "52 mm")
    page.after(600)
    page.settle()
    assert page.place("sensor") == "52 mm"
    page.until(page.button("Undo").is_disabled, True)


def focused(page):
    """How what has the focus is called."""
    return page.page.evaluate(
        "(() => { let at = document.activeElement;"
        " while (at?.shadowRoot?.activeElement) at = at.shadowRoot.activeElement;"
        " return at?.getAttribute('aria-label') ?? at?.textContent ?? ''; })()"
    )


def tabbed(page, until, key="Tab"):
    """What is reached by Tab until something that begins so has the focus."""
    reached = []
    while not (reached and reached[-1].startswith(until)):
        assert len(reached) < 40, f"{until} is not reached by {key}: {reached}"
        page.page.keyboard.press(key)
        reached.append(focused(page))
    return reached


def test_bench_is_worked_by_keyboard_alone(page):
    reached = tabbed(page, "The picture.")
    words = " ".join(reached)
    for each in ("Open", "Export", "lens main", "mask code", "sensor", "Zoom in", "Click to focus", "Pin"):
        assert each in words
    page.page.keyboard.press("ArrowRight")
    page.page.get_by_text("column 41, row 30").wait_for()
    tabbed(page, "mask code:", "Shift+Tab")
    page.page.keyboard.press("Enter")  # types a place
    page.page.keyboard.type("31.5")
    page.page.keyboard.press("Enter")
    page.wait_for_place(1, "31.5 mm")
    tabbed(page, "mask code:", "Shift+Tab")
    page.page.keyboard.press("Delete")
    page.part(1).wait_for(state="detached")


def test_places_are_typed_with_their_units_and_what_is_no_length_is_refused_at_its_field(page):
    for typed, place in (("41.5 mm", "41.5 mm"), ("47", "47 mm"), ("4.85 cm", "48.5 mm")):
        page.page.locator("#sensor-z").fill(typed)
        page.page.keyboard.press("Enter")
        page.wait_for_place("sensor", place)
    page.page.locator("#sensor-z").fill("far")
    page.page.keyboard.press("Enter")
    page.page.get_by_role("alert").get_by_text("not a length").wait_for()
    assert page.place("sensor") == "48.5 mm"
    field = page.page.locator("#sensor-z")
    page.until(field.input_value, "4.85")  # as it was typed, and its unit behind it
    unit = page.page.locator("#sensor-z + .unit")
    page.until(unit.text_content, "cm")
    for typed, said in (("1e400", "a finite number"), ("1e400 mm", "a finite number"), ("53 kg", "not a length")):
        field.fill(typed)
        page.page.keyboard.press("Enter")
        page.page.get_by_role("alert").get_by_text(said).wait_for()
    field.fill("5.1")
    page.page.keyboard.press("Enter")
    page.wait_for_place("sensor", "51 mm")  # the unit that is shown
    field.fill("52.5 mm")
    page.page.keyboard.press("Enter")
    page.wait_for_place("sensor", "52.5 mm")
    page.until(unit.text_content, "mm")
    page.page.locator("#sensor-decentre").fill("0.5, 0")
    page.page.keyboard.press("Enter")
    page.settle()
    page.until(page.page.locator("#sensor-decentre").input_value, "0.5 mm, 0 mm")  # not metres


def test_elements_are_added_edited_and_removed(page):
    page.page.get_by_label("Add an element").select_option("diffuser")
    page.wait_for_place(2, "0 mm")  # at the lens, where it makes sense
    page.page.locator("#elements-2-kernel-sigma").fill("0.02")
    page.page.keyboard.press("Enter")
    page.settle()
    page.button("Duplicate").click()
    page.part(3).wait_for()
    page.button("Remove").click()
    page.part(3).wait_for(state="detached")
    page.page.get_by_role("tab", name="mask code").click()
    page.page.locator(".grid i").first.click()  # a cell of the drawn pattern
    page.settle()
    page.until(
        page.page.locator("#elements-1-pattern-cells").input_value,
        lambda cells: cells.split() == ["0", "0", "0", "1"],
    )
    page.page.get_by_label("Add an element").select_option("achromat-100mm")
    surfaces = page.page.get_by_role("region", name="surfaces").locator("tr")
    page.until(surfaces.all_text_contents, lambda rows: len(rows) == 4 and "{" not in rows[1])  # names, and three


def test_address_holds_the_camera_for_another_window_and_for_a_reload(page, browser, served):
    page.page.wait_for_url("**#d=*")
    before = page.page.url
    page.page.locator("#sensor-z").fill("50.5 mm")
    page.page.keyboard.press("Enter")
    page.page.wait_for_url(lambda address: address != before)  # it is written when the bench rests
    other = Page(browser, page.page.url)
    assert other.place("sensor") == "50.5 mm"
    other.page.locator("#sensor-z").fill("51 mm")
    other.page.keyboard.press("Enter")
    other.wait_for_place("sensor", "51 mm")
    other.close()
    assert page.place("sensor") == "50.5 mm"  # a window has a camera of its own
    page.page.reload()
    page.wait_for_place("sensor", "50.5 mm")
    cut = Page(browser, served.address + "#d=" + page.page.url.partition("#d=")[2][:40])
    cut.page.get_by_text("is cut or damaged: copy the whole address again").wait_for()
    assert cut.place("sensor") == "52 mm"
    cut.close()


def test_server_goes_and_comes_back_and_the_camera_is_still_there(page, served):
    page.page.locator("#sensor-z").fill("51.25 mm")
    page.page.keyboard.press("Enter")
    page.settle()
    served.stop()
    page.page.get_by_text("The server is gone").wait_for()
    served.start()
    page.page.get_by_text("The server is gone").wait_for(state="detached")
    page.settle()
    page.wait_for_place("sensor", "51.25 mm")


def test_connection_breaks_and_steps_and_pinned_picture_are_still_there(page, served):
    page.button("Pin").click()
    page.page.get_by_text("now · the same").wait_for()
    page.page.locator("#sensor-z").fill("51.5 mm")
    page.page.keyboard.press("Enter")
    page.settle()
    (said,) = page.until(page.page.get_by_text("dB").all_text_contents, lambda texts: len(texts) == 1)
    served.break_off()
    page.page.get_by_text("The server is gone").wait_for()
    page.page.get_by_text("The server is gone").wait_for(state="detached")
    page.settle()
    page.until(page.page.get_by_text("dB").all_text_contents, [said])
    page.button("Undo").click()
    page.wait_for_place("sensor", "52 mm")
    page.page.get_by_text("now · the same").wait_for()


def test_pinned_picture_is_compared_with(page):
    page.button("Pin").click()
    page.page.get_by_text("now · the same").wait_for()
    page.page.locator("#sensor-z").fill("54 mm")
    page.page.keyboard.press("Enter")
    page.page.get_by_text("dB").wait_for()
    pictures = []
    for mode in ("alone", "beside", "wipe", "difference"):
        page.page.get_by_label("Compare with the pinned picture").select_option(mode)
        pictures.append(page.until(page.picture, lambda shown: shown not in pictures))


def test_camera_and_film_are_taken_away(page):
    page.page.get_by_text("Export").click()
    with page.page.expect_download() as taken:
        page.page.get_by_role("button", name="Camera file").click()
    with zipfile.ZipFile(taken.value.path()) as archive:  # with the cells of its mask
        assert tomllib.loads(archive.read("camera.toml").decode())["sensor"]["z"] == "52 mm"
    page.page.get_by_text("Export").click()
    page.page.get_by_role("button", name="Film of a sweep").click()
    page.page.locator('input[name="frames"]').fill("3")
    with page.page.expect_download() as taken:
        page.button("Make the film").click()
    assert Path(taken.value.path()).read_bytes().startswith(b"GIF8")
    assert page.place("sensor") == "52 mm"


def test_program_that_is_taken_away_makes_the_identical_picture(page, tmp_path, monkeypatch):
    page.page.locator("#sensor-z").fill("53 mm")
    page.page.keyboard.press("Enter")
    page.settle()
    for button, name in (("Python program", "program.zip"), ("Picture (PNG)", "wanted.png")):
        page.page.get_by_text("Export").click()
        with page.page.expect_download() as taken:
            page.page.get_by_role("button", name=button).click()
        taken.value.save_as(tmp_path / name)
    program = tmp_path / "program.zip"
    if zipfile.is_zipfile(program):
        zipfile.ZipFile(program).extractall(tmp_path)
    else:
        program.rename(tmp_path / "picture.py")
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        runpy.run_path("picture.py")
    assert (tmp_path / "picture.png").read_bytes() == (tmp_path / "wanted.png").read_bytes()


def test_pictures_of_each_kind_of_element_are_taken_away_as_the_library_makes_them(page, served):
    field = served.offered.fields["scene"].whole()
    adds = page.page.get_by_label("Add an element")
    kinds = [each.get_attribute("value") for each in adds.locator("option").all()]
    assert len(kinds) > 15
    for kind in kinds:
        if not kind or kind in built_in_lenses():  # these: test_editing.py
            continue
        adds.select_option(kind)
        page.page.get_by_role("tab", name=kind.replace("_", " ")).first.wait_for()
        page.settle()
        page.page.get_by_text("Export").click()
        with page.page.expect_download() as taken:
            page.page.get_by_role("button", name="Picture (PNG)").click()
        document, white = page.page.evaluate(
            """() => {
                const { bench } = document.querySelector("vcc-bench");
                return [bench.document, bench.picture.about.white];
            }"""
        )
        shown = Document.of_json(document)
        train = shown.train(served.offered.beside).train
        expected = io.BytesIO()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
            image = vcc.Camera(train.elements, train.sensor).capture(shown.coloured(field))
            image.save(expected, format="png", exposure=1 / white)
        assert Path(taken.value.path()).read_bytes() == expected.getvalue(), kind
        page.button("Undo").click()


def test_neighbours_trade_places_by_their_buttons(page):
    page.page.get_by_role("tab", name="mask code").click()
    page.until(page.button("Move behind the one behind it").is_disabled, True)
    page.button("Move before the one before it").click()
    page.wait_for_place(1, "0 mm")
    assert page.place(0) == "26 mm"
    page.until(page.button("Move before the one before it").is_disabled, True)
    page.button("Undo").click()
    page.wait_for_place(1, "26 mm")
    assert page.place(0) == "0 mm"


def test_click_focuses_where_it_was_clicked(page):
    page.button("Click to focus").click()
    box = page.page.locator("canvas").bounding_box()
    page.page.mouse.click(box["x"] + box["width"] * 0.05, box["y"] + box["height"] / 2)  # near leaves
    page.page.wait_for_selector('button[aria-label="Undo"]:not([disabled])')
    page.settle()
    assert 52.5 < float(page.place("sensor").removesuffix(" mm")) < 54


def without_fault(page):
    """What axe sees has no serious fault."""
    found = page.page.evaluate("axe.run({ resultTypes: ['violations'] })")["violations"]
    serious = [each for each in found if each["impact"] in ("serious", "critical")]
    assert serious == [], json.dumps(serious, indent=1)[:3000]


@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_accessibility_has_no_serious_fault(browser, served, scheme, width):
    if not AXE.exists():
        pytest.skip("axe is not installed: run npm ci in bench/front, as .ci/run does")
    page = Page(browser, served.address, width, 800, color_scheme=scheme, bypass_csp=True)
    page.page.evaluate(AXE.read_text(encoding="utf-8"))
    without_fault(page)
    page.page.get_by_text("Export").click()
    page.page.get_by_role("button", name="Film of a sweep").click()
    page.page.get_by_role("tab", name="mask code").click()
    without_fault(page)
    decoded_and_refocused(page)
    without_fault(page)
    wider = page.page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    assert wider <= 0  # nothing has to be scrolled sideways
    page.page.get_by_role("tab", name="Parts").click()
    page.page.get_by_role("tab", name="light field").click()
    page.page.get_by_role("tab", name="Phase space").click()
    page.page.locator("#pane figure").first.wait_for()
    without_fault(page)
    page.page.get_by_text("Open", exact=True).click()
    item = page.page.get_by_role("button", name="Camera file")
    item.evaluate("button => button.append(' with a name that is long'.repeat(5))")
    box = item.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= width
    page.close()


def decoded_and_refocused(page):
    """A camera that can be decoded has a tab, and in it a slider of distance that works by keys."""
    tab = page.page.get_by_role("tab", name="Decoded")
    assert tab.count() == 0
    page.page.get_by_text("Open", exact=True).click()
    page.button("lenslets").click()
    tab.click()
    refocused = page.page.get_by_role("img", name="Picture refocused on what is ")
    before = refocused.get_attribute("src")
    slider = page.page.get_by_role("slider", name="Refocused")
    slider.press("End")
    page.until(lambda: slider.get_attribute("aria-valuetext"), "at 3 m")
    page.page.get_by_role("img", name="Picture refocused on what is at 3 m").wait_for()
    assert refocused.get_attribute("src") != before
    page.button("as the camera is").click()
    page.page.get_by_role("img", name="Picture refocused on what is at 1.3 m").wait_for()


def test_phase_space_is_shown_at_any_plane_and_follows_the_camera(page):
    page.page.get_by_role("tab", name="Phase space").click()
    figures = page.page.locator("#pane figure")
    page.until(figures.count, 4)
    field = page.page.get_by_label("plane at")
    field.fill("30")
    field.press("Enter")
    page.page.get_by_text("z = 30 mm", exact=True).wait_for()
    slider = page.page.get_by_role("slider", name="Plane along the axis")
    slider.focus()
    page.page.keyboard.press("End")
    page.page.get_by_text("z = 52 mm", exact=True).wait_for()
    page.until(figures.count, 1)
    page.part("sensor").focus()
    page.page.keyboard.press("Shift+ArrowLeft")
    page.page.get_by_text("z = 51 mm", exact=True).wait_for()
    page.until(field.input_value, "51 mm")
    page.button("Each plane").click()
    figures.nth(3).wait_for()


def test_light_field_is_moved_by_its_handle_and_typed_and_stays_in_the_address(page, served):
    place = page.place("light field")
    assert place == "0 mm"
    box = page.part("light field").locator(".handle").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before = page.picture()
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x - 60, y, steps=4)
    page.page.mouse.up()
    page.settle()
    dragged = page.place("light field")
    assert -15 < float(dragged.removesuffix(" mm")) < -4
    assert page.picture() != before
    field = page.page.get_by_label("decentre", exact=True)  # the light field's: it is selected
    field.fill("1 mm, 0 mm")
    written = page.page.url
    field.press("Enter")
    page.settle()
    page.page.wait_for_url(lambda address: address != written)  # it is written when the bench rests
    again = Page(page.context.browser, page.page.url)
    assert again.place("light field") == dragged
    again.close()
    field.fill("1")
    field.press("Enter")
    page.page.get_by_text("decentre of the light field is two lengths").wait_for()
    page.page.keyboard.press("Escape")
    page.button("Undo").click()
    page.button("Undo").click()
    page.wait_for_place("light field", "0 mm")
