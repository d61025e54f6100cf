"""The drawing of the bench in headless Chromium: looked at closely, changed by its handles; mouse, touch, keys."""

import pytest

from tests.bench.browser import Page


def apart(page):
    """Pixels of the page from the lens to the sensor."""
    return page.middle("sensor")[0] - page.middle("0")[0]


def test_wheel_and_keys_zoom_where_the_pointer_is_and_all_of_it_comes_back(page):
    before, (x, y) = apart(page), page.middle("1")
    page.page.mouse.move(x, y)
    page.page.mouse.wheel(0, -400)
    page.until(lambda: apart(page), lambda now: now > 2 * before)
    assert page.middle("1")[0] == pytest.approx(x, abs=1)
    page.button("The whole drawing").click()
    page.until(lambda: apart(page), pytest.approx(before, abs=1))
    page.part("1").focus()
    page.page.keyboard.press("+")
    page.until(lambda: apart(page), pytest.approx(1.5 * before, abs=2))
    page.page.keyboard.press("0")
    page.until(lambda: apart(page), pytest.approx(before, abs=1))


def test_zoomed_drawing_is_moved_and_a_part_dragged_by_tenths_of_a_pixel_of_before(page):
    box = page.part("sensor").locator(".strip").bounding_box()
    x, y = box["x"] + 6, box["y"] + box["height"] / 3  # where its front is
    page.page.mouse.move(x, y)
    for _ in range(3):
        wide = apart(page)
        page.page.mouse.wheel(0, -500)
        page.until(lambda: apart(page), lambda now, wide=wide: now > 2 * wide)
    page.page.mouse.down()
    page.page.mouse.move(x + 12, y, steps=3)
    page.page.mouse.up()
    page.settle()
    moved = float(page.place("sensor").removesuffix(" mm")) - 52
    assert 0 < moved < 0.2  # 12 pixels were some 1.6 mm before
    page.drawn()
    before = page.middle("sensor")[0]
    page.page.mouse.move(x - 150, y + 60)
    page.page.mouse.down()
    page.page.mouse.move(x - 180, y + 60, steps=3)
    page.page.mouse.up()
    page.until(lambda: page.middle("sensor")[0], pytest.approx(before - 30, abs=1))
    assert float(page.place("sensor").removesuffix(" mm")) == 52 + moved


def test_two_fingers_zoom_and_one_moves_a_part(browser, served):
    page = Page(browser, served.address, 390, 800, has_touch=True)
    before, (x, y) = apart(page), page.middle("1")
    session = page.context.new_cdp_session(page.page)

    def touch(kind, *places):
        points = [{"x": px, "y": py, "id": number} for number, (px, py) in enumerate(places)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (x - 20, y))
    touch("touchStart", (x - 20, y), (x + 20, y))
    for step in range(1, 9):
        touch("touchMove", (x - 20 - 5 * step, y), (x + 20 + 5 * step, y))
    touch("touchEnd")
    page.until(lambda: apart(page), pytest.approx(3 * before, rel=0.1))
    assert page.place("1") == "26 mm"  # zooming moves nothing
    page.button("The whole drawing").click()
    page.until(lambda: apart(page), pytest.approx(before, abs=1))
    x, y = page.middle("sensor")
    touch("touchStart", (x, y))
    for step in range(1, 9):
        touch("touchMove", (x - 5 * step, y))
    touch("touchEnd")
    page.until(lambda: page.place("sensor"), lambda place: float(place.removesuffix(" mm")) < 48)
    page.close()


def test_drag_there_and_back_ends_where_it_began(page):
    x, y = page.middle("sensor")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    for by in (10, 20, 30, 40, 30, 40, 30, 40, 20, 10, 0):  # which is close to the border of the drawing
        page.page.mouse.move(x + by, y)
    page.page.mouse.up()
    page.settle()
    assert float(page.place("sensor").removesuffix(" mm")) == pytest.approx(52, abs=0.05)


def test_escape_takes_back_what_is_dragged(page):
    page.page.locator("#sensor-z").fill("5.21234567891 cm")  # as it was typed, not as it is drawn
    page.page.keyboard.press("Enter")
    page.wait_for_place("sensor", "52.1235 mm")
    page.settle()
    x, y = page.middle("sensor")
    for grip, by in (((x, y), (-40, 0)), (handle(page, "pitch")[1:], (0, 30))):
        page.page.mouse.move(*grip)
        page.page.mouse.down()
        page.page.mouse.move(grip[0] + by[0], grip[1] + by[1], steps=4)
        page.page.keyboard.press("Escape")
        page.page.mouse.move(grip[0] + 2 * by[0], grip[1] + 2 * by[1], steps=2)  # which moves nothing
        page.page.mouse.up()
        page.settle()
        sensor = page.page.evaluate("document.querySelector('vcc-bench').bench.document.camera.sensor")
        assert sensor == {"z": "5.21234567891 cm", "shape": [60, 80], "pitch": "0.25 mm"}
    page.button("Undo").click()  # the typed place is the one step
    page.wait_for_place("sensor", "52 mm")


def test_drawing_follows_what_is_dragged_over_its_end(page):
    x, y = page.middle("sensor")
    edge = page.page.locator("vcc-bench-side").bounding_box()
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    for _ in range(12):
        page.page.mouse.move(edge["x"] + edge["width"] - 8, y)
        page.page.mouse.move(edge["x"] + edge["width"] - 4, y)
    page.page.mouse.up()
    page.settle()
    assert float(page.place("sensor").removesuffix(" mm")) > 58
    page.drawn()
    box = page.part("sensor").locator(".strip").bounding_box()
    assert box["x"] + box["width"] <= edge["x"] + edge["width"] + 20


def handle(page, words):
    """A handle of what is selected, and its middle."""
    found = page.page.locator(f'[data-handle="{words}"]')
    found.wait_for()
    box = found.locator("circle, path:not(.cone)").first.bounding_box()
    return found, box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_handles_change_diameter_and_focal_length_and_decentre_where_a_hand_takes_them(page):
    page.page.get_by_role("tab", name="lens main").click()
    _, x, y = handle(page, "diameter")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y + 20, steps=4)
    page.page.mouse.up()
    page.settle()
    smaller = float(page.page.locator("#elements-0-diameter").input_value())
    assert 8 < smaller < 17
    assert handle(page, "diameter")[2] == pytest.approx(y + 20, abs=2)  # the rim is where the hand left it
    knob, x, y = handle(page, "focal length")
    assert knob.get_attribute("aria-valuetext") == "focal length 50 mm"
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x - 30, y, steps=4)
    page.page.mouse.up()
    page.settle()
    assert handle(page, "focal length")[1] == pytest.approx(x - 30, abs=2)
    assert 40 < float(page.page.locator("#elements-0-focal_length").input_value()) < 49
    _, x, y = handle(page, "decentre")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y - 15, steps=3)
    page.page.mouse.up()
    page.settle()
    right, down = page.page.locator("#elements-0-decentre").input_value().split(", ")
    assert 0.5 < float(right.removesuffix(" mm")) < 4
    assert down == "0 mm"
    for _ in range(3):  # each was one step
        page.button("Undo").click()
        page.settle()
    assert page.page.locator("#elements-0-diameter").input_value() == "18"
    page.page.locator("#elements-0-focal_length").fill("200")  # focuses far behind the drawing
    page.page.keyboard.press("Enter")
    page.settle()
    edge = page.page.locator("vcc-bench-side").bounding_box()
    _, x, y = handle(page, "focal length")
    assert x < edge["x"] + edge["width"]
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x - 30, y, steps=4)
    page.page.mouse.up()
    page.settle()
    assert 190 < float(page.page.locator("#elements-0-focal_length").input_value()) < 200


def test_handle_of_an_angle_filter_is_on_its_steepest_ray(page):
    page.page.get_by_label("Add an element").select_option("angle_filter")
    page.page.get_by_role("tab", name="angle filter").wait_for()
    page.settle()
    _, x, y = handle(page, "slope")
    assert x == pytest.approx(page.middle(0)[0], abs=1)  # at the entrance plane, where the lens is
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y + 20, steps=4)
    page.page.mouse.up()
    page.settle()
    knob, _, below = handle(page, "slope")
    assert below == pytest.approx(y + 20, abs=2)
    diameter = float(page.page.locator("#elements-2-pattern-diameter").input_value())  # 1 m for a slope of 1
    assert knob.get_attribute("aria-valuetext").startswith(f"slope ±{diameter / 2e3:.3g}")


def test_handles_are_worked_by_keys_and_the_sensor_has_them_too(page):
    page.part("sensor").focus()
    knob, _, _ = handle(page, "pitch")
    knob.focus()
    page.page.keyboard.press("ArrowUp")
    page.after(700)  # longer than the pause that ends a movement
    page.settle()
    page.until(page.page.locator("#sensor-pitch").input_value, "0.255 mm")
    page.button("Upwards: x").click()
    page.button("Upwards: y").wait_for()
    knob, _, _ = handle(page, "decentre")
    knob.focus()
    page.page.keyboard.press("Shift+ArrowUp")
    page.after(700)
    page.settle()
    page.until(page.page.locator("#sensor-decentre").input_value, "0 mm, 0.5 mm")


def test_click_on_what_is_selected_takes_the_next_in_the_same_plane(page):
    page.page.get_by_role("tab", name="mask code").click()
    page.page.locator("#elements-1-z").fill("0 mm")
    page.page.keyboard.press("Enter")
    page.wait_for_place(1, "0 mm")
    x, y = page.middle("0")
    chosen = page.page.locator('.chips [aria-selected="true"]')
    for _ in range(3):
        before = chosen.text_content()
        assert before in ("lens main", "mask code")
        page.page.mouse.click(x, y)
        page.until(chosen.all_text_contents, [{"lens main": "mask code", "mask code": "lens main"}[before]])
    page.until(page.page.locator(".label text").filter(has_text="+").count, 1)  # one label for both


def test_lenslets_close_to_the_sensor_are_seen_in_the_magnifier(page):
    page.page.get_by_text("Open", exact=True).click()
    page.button("lenslets").click()
    page.part("1").wait_for()
    page.settle()
    inset = page.page.locator(".magnifier")
    page.until(
        inset.locator("text").all_text_contents,
        lambda texts: len(texts) == 1 and float(texts[0].removesuffix("×")) >= 4,
    )
    page.until(inset.locator(".glass").count, lambda glasses: glasses >= 1)
    page.button("Magnifier").click()
    page.until(inset.count, 0)


def test_added_elements_stand_where_they_make_sense(page):
    add = page.page.get_by_label("Add an element")
    for kind, number, least, most in (("phase_plate", 2, 0, 0), ("lens_array", 3, 40, 51.9), ("lens", 4, 1, 51)):
        add.select_option(kind)
        place = page.until(lambda number=number: page.place(number), bool)
        assert least <= float(place.removesuffix(" mm")) <= most
