"""What one expects of a viewer of pictures, and comparing many: the bench in headless Chromium."""

import io

import numpy as np
import PIL.Image

from tests.bench.browser import CAMERA, Page, Served


def canvas(page):
    """The canvas as it looks, as numbers."""
    return np.asarray(PIL.Image.open(io.BytesIO(page.picture())).convert("RGB")).astype(int)


def changed(page, before):
    """Wait until the canvas looks different."""
    return page.until(
        lambda: canvas(page), lambda now: now.shape != before.shape or np.abs(now - before).max() > 8
    )


def test_levels_show_what_is_clipped_and_change_black_white_and_channel(page):
    before = canvas(page)
    page.button("Levels").click()
    levels = page.page.locator("vcc-bench-levels")
    page.until(levels.locator(".bars").count, 3)
    levels.locator(".clipped").get_by_text("above white").wait_for()
    panel = canvas(page)
    levels.get_by_label("black").first.press("Shift+ArrowRight")
    darker = changed(page, panel)
    levels.get_by_label("Channel").select_option("0")
    red = changed(page, darker)
    middle = red[60:200, 300:500]  # of the picture, above the panel
    assert np.abs(middle[..., 0] - middle[..., 1]).max() <= 2  # one channel is grey
    levels.get_by_label("linear").check()
    changed(page, red)
    levels.get_by_role("slider", name="white").press("ArrowLeft")
    page.until(page.page.get_by_label("Fix exposure").is_checked, True)
    levels.get_by_label("linear").uncheck()
    levels.get_by_label("Channel").select_option("")
    levels.get_by_role("button", name="Auto").click()
    page.button("Levels").click()

    def as_before(now):
        return now.shape == before.shape and np.abs(now - before).mean() < 1

    page.until(lambda: canvas(page), as_before)


def test_pointer_reads_values_and_the_place_on_the_sensor(page):
    box = page.page.locator("canvas").bounding_box()
    page.page.mouse.move(box["x"] + box["width"] / 2 + 2, box["y"] + box["height"] / 2 + 2)
    page.page.get_by_text("column 40, row 30").wait_for()
    # The pixel right of the middle and below it, as seen; the sensor's image is inverted: half a pitch of 0.25 mm.
    page.page.get_by_text("x -0.125 mm, y -0.125 mm").wait_for()
    page.page.get_by_role("checkbox", name="Noise").check()
    page.page.mouse.move(box["x"] + box["width"] / 2 + 2, box["y"] + box["height"] / 2)
    reading = page.page.locator(".line [role=status]", has_text="DN")
    fits = "of => of.scrollWidth <= of.clientWidth && of.scrollHeight <= of.parentElement.clientHeight"
    page.until(lambda: reading.evaluate_all(f"all => all.map({fits})"), [True])


def test_profile_along_a_line_is_drawn_by_mouse_and_by_keys(page):
    page.button("Profile along a line").click()
    box = page.page.locator("canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(x - 100, y)
    page.page.mouse.down()
    page.page.mouse.move(x + 100, y, steps=4)
    page.page.mouse.up()
    plot = page.page.get_by_role("img", name="Irradiance along a line of")
    page.until(plot.locator("path.red").count, 1)
    words = plot.get_attribute("aria-label")
    page.page.locator("canvas").focus()
    page.page.keyboard.press("p")  # ends
    page.until(plot.count, 0)
    page.page.keyboard.press("ArrowRight")
    page.page.keyboard.press("p")
    for _ in range(4):
        page.page.keyboard.press("ArrowRight")
    page.page.get_by_role("img", name="Irradiance along a line of 1 mm").wait_for()  # four pixels of 0.25 mm
    assert words != "Irradiance along a line of 1 mm"


def test_picture_is_downloaded_as_it_is_shown(page):
    with page.page.expect_download() as taken:
        page.button("Download as shown").click()
    saved = np.asarray(PIL.Image.open(taken.value.path()).convert("RGB")).astype(int)
    shown = canvas(page)
    assert np.abs(np.array(saved.shape) - shown.shape).max() <= 1  # half a pixel of the page
    assert np.abs(saved[100:600, 100:600] - shown[100:600, 100:600]).mean() < 4  # which begins within a pixel


def put(page, place):
    """Type the place of the sensor."""
    page.page.get_by_role("tab", name="sensor").click()
    page.page.locator("#sensor-z").fill(place)
    page.page.keyboard.press("Enter")
    page.wait_for_place("sensor", place)
    page.settle()


def test_pinned_states_are_a_strip_to_compare_with_and_to_return_to(page):
    for place in ("51 mm", "52.5 mm", "54 mm"):
        put(page, place)
        page.button("Pin").click()
        page.page.get_by_text("now · the same").wait_for()
    pins = page.page.locator("vcc-bench-pins li")
    page.until(
        pins.all_text_contents,
        lambda texts: len(texts) == 3 and "z 54 mm" in texts[2] and "compared" in texts[2] and "dB" in texts[0],
    )
    page.button("Return to pinned state 1: main, code, sensor").click()
    page.wait_for_place("sensor", "51 mm")
    page.settle()
    page.page.locator(".caption.right").get_by_text("dB").wait_for()
    pins.nth(0).get_by_title("Compare with this state").click()
    page.page.get_by_text("now · the same").wait_for()
    page.button("Unpin 2").click()
    page.page.wait_for_function("() => document.querySelector('vcc-bench').bench.pins.length === 2")
    page.button("Undo").click()  # returning was one step
    page.wait_for_place("sensor", "54 mm")


def test_frames_of_a_sweep_are_gone_through_by_hand(page):
    page.page.get_by_role("tab", name="sensor").click()
    page.page.get_by_text("Export").click()
    page.page.get_by_role("button", name="Film of a sweep").click()
    page.page.locator('input[name="frames"]').fill("5")
    page.button("Scrub by hand").click()
    slider = page.page.get_by_label("Frame of the sweep")
    slider.wait_for()
    slider.focus()
    pictures = [page.picture()]
    for _ in range(4):
        page.page.keyboard.press("ArrowRight")
        pictures.append(page.until(page.picture, lambda shown: shown != pictures[-1]))
    page.until(lambda: slider.get_attribute("aria-valuetext"), "z 53 mm")
    page.page.get_by_role("button", name="Close").click()
    page.until(slider.count, 0)
    assert page.place("sensor") == "52 mm"


def test_photodiodes_stand_side_by_side(page):
    page.page.get_by_role("tab", name="sensor").click()
    page.page.locator("#sensor-photodiodes").fill("1, 2")
    page.page.keyboard.press("Enter")
    shows_two = "() => document.querySelector('vcc-bench').bench.picture.about.photodiodes[1] === 2"
    page.page.wait_for_function(shows_two)
    page.settle()
    page.button("Levels").click()
    page.page.get_by_label("photodiodes side by side").check()
    page.page.get_by_text("1 × 2 photodiodes").wait_for()
    assert page.page.evaluate("document.querySelector('vcc-bench').bench.picture.about.shape") == [60, 160]


def test_ten_masks_of_many_cells_are_opened_and_the_connection_stands(page):
    random = np.random.default_rng(1)
    cells = [[[round(float(x), 4) for x in row] for row in random.uniform(0.2, 1, (128, 128))] for _ in range(10)]
    masks = [
        {"kind": "mask", "name": f"m{n}", "z": f"{2 + 4 * n} mm", "pattern": each, "width": "20 mm"}
        for n, each in enumerate(cells)
    ]
    document = {"camera": {"elements": [CAMERA["elements"][0], *masks], "sensor": CAMERA["sensor"]}}
    page.page.evaluate(
        "given => document.querySelector('vcc-bench').bench.act({ do: 'load', document: given })",
        {**document, "light_field": "scene"},
    )
    page.part("10").wait_for()
    page.settle()
    assert page.page.get_by_text("The server is gone").count() == 0
    page.page.get_by_role("tab", name="sensor").click()
    put(page, "51 mm")


def test_places_in_fields_and_drawing_agree_while_the_server_is_away(page, served):
    served.stop()
    page.page.get_by_text("The server is gone").wait_for()
    x, y = page.middle("sensor")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x - 50, y, steps=4)
    page.page.mouse.up()
    page.drawn()
    drawn = page.place("sensor")
    assert drawn != "52 mm"
    assert page.page.locator("#sensor-z").input_value() == drawn.removesuffix(" mm")
    page.page.get_by_label("Add an element").select_option("diffuser")
    page.page.get_by_text("This was not done, because there is no connection").wait_for()
    for field, typed in (("sensor-z", "far"), ("sensor-pitch", "0.2 mm"), ("sensor-decentre", "wide, 0 mm")):
        page.page.locator(f"#{field}").fill(typed)
        page.page.keyboard.press("Enter")
    served.start()
    page.page.get_by_text("The server is gone").wait_for(state="detached")
    page.settle()
    # Only what makes no sense is refused, each at its field; all else that was changed meanwhile is kept.
    page.wait_for_place("sensor", "52 mm")
    page.until(page.page.locator("#sensor-pitch").input_value, "0.2 mm")
    page.until(page.page.locator("#sensor-decentre").input_value, "")
    refused = 'z is "far", which is not a length; write it like 50 mm'
    page.until(
        page.page.get_by_role("alert").all_text_contents,
        lambda words: len(words) == 2 and refused in words[0] and "decentre" in words[1],
    )


def test_page_without_the_token_says_what_is_missing_and_does_not_try_for_ever(browser, served):
    context = browser.new_context()
    page = context.new_page()
    opened = []
    page.on("websocket", lambda socket: opened.append(socket))
    page.goto(served.address.partition("?")[0])
    page.get_by_text("This address lacks the token of the bench").wait_for()
    page.evaluate("new Promise((later) => setTimeout(later, 1500))")  # thrice what it waits for a second try
    assert len(opened) == 1
    context.close()


def test_presets_have_pictures_and_open(browser):
    from vcc.bench.cameras import SCENE, cameras, scenes
    from vcc.bench.published import Gallery
    from vcc.bench.starting import PRESETS, presets

    gallery = Gallery(cameras(SCENE), SCENE)
    found = presets(gallery)
    assert list(found) == list(PRESETS)
    assert len(found) == 6
    bench = Served()
    bench.offered = type(bench.offered)(
        {name: field for name, field in scenes().items() if name == SCENE},
        gallery["A lens"],
        bench.offered.beside,
        {title: gallery[title] for title in ("A lens", "A coded aperture")},
        found,
    )
    bench.start()
    page = Page(browser, bench.address)
    page.page.get_by_text("Open", exact=True).click()
    pictures = page.page.locator(".preset img")
    page.until(lambda: pictures.evaluate_all("all => all.map(each => each.naturalWidth >= 100)"), [True] * 6)
    page.page.locator(".preset").nth(1).click()
    page.wait_for_place("1", "0 mm")
    page.close()
    bench.stop()
