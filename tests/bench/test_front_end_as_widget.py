"""The module as a notebook takes it, on a plain page: a model made up here has what anywidget promises alone."""

import pytest

from tests.bench.browser import PATIENCE, chromium
from vcc.bench.server import static_files

PAGE = """<!doctype html><body style="font: italic 30px serif; letter-spacing: 4px; background: #fff; color: #000">
<style>button { display: none !important } svg { fill: red }</style>
<p>Around it.</p><div id="one"></div><div id="two"></div><div id="other"></div></body>"""
"""Of a strange host: its styles are not those of the bench."""

HOST = """async () => {
  const kinds = {kind: "lens", words: "A lens.", parameters: []};
  const place = {
    name: "z", words: "", unit: "length", needed: true, default: null, takes: ["number"], choices: [],
  };
  const parts = {
    is: "parts", light_fields: ["scene"], kinds: [kinds], sensor: [place], families: {}, gallery: [], presets: [],
  };
  const state = (turn, z) => ({
    is: "state", turn, undo: false, redo: false, grid: [3, 3, 8, 8, 3], bands: null,
    document: {
      camera: {elements: [], sensor: {z: `${z} mm`, shape: [8, 8], pitch: "1 mm"}}, light_field: "scene",
      views: null, aperture: {z: "0 mm", decentre: ["0 mm", "0 mm"]}, wavelengths: null,
      exposure: null, noise: false,
    },
    side: {
      axis: "x", start: -0.02, end: 0.06, half: 0.01, elements: [], rays: [], aperture: null, snaps: [], words: [],
      sensor: {z: z / 1000, half: 0.004, decentre: 0, label: ["sensor"], handles: []},
    },
  });
  const square = document.createElement("canvas");
  square.width = square.height = 8;
  square.getContext("2d").fillRect(0, 0, 4, 8);
  const blob = await new Promise((then) => square.toBlob(then, "image/jpeg"));
  const bytes = new Uint8Array(await blob.arrayBuffer());
  // As Jupyter has them: each buffer is a view into a longer one, that begins somewhere.
  const frame = new Uint8Array(bytes.length + 20).fill(7);
  frame.set(bytes, 13);
  const picture = () => new DataView(frame.buffer, 13, bytes.length);
  class Model {
    sent = []; handlers = new Set();
    send(message, callbacks, buffers) {
      if (callbacks !== undefined || !Array.isArray(buffers)) throw Error("not as anywidget has it");
      this.sent.push(message);
      const tell = (said, ...more) => { for (const each of [...this.handlers]) each(said, ...more) };
      setTimeout(() => {
        tell({is: "heard"});
        if (message.do === "hello") tell(parts, []);
        if (message.do === "hello" || message.do === "set") {
          const z = message.do === "set" ? parseFloat(message.value) : 52;
          tell(state(message.turn, z), []);
          const look = {black: 0, linear: false, channel: null, photodiodes: "sum", axis: "x"};
          const about = {
            coarse: false, moving: false, shape: [8, 8], white: 1, look, channels: 3, photodiodes: [1, 1],
            missing: 0, by_rays: false, took: 1, psnr: null, same: false, histogram: null,
          };
          tell({is: "picture", turn: message.turn, ...about}, [picture()]);
        }
      });
    }
    on(name, handler) { if (name === "msg:custom") this.handlers.add(handler) }
    off(name, handler) { if (name === "msg:custom") this.handlers.delete(handler) }
  }
  const { default: made } = await import("/bench.js");
  window.keys = [];
  for (const kind of ["keydown", "keyup"]) window.addEventListener(kind, (event) => window.keys.push(event.key));
  window.widgets = [];
  for (const places of [["one", "two"], ["other"]]) {
    const model = new Model(), widget = await made();
    const leave = [await widget.initialize({ model })];
    for (const place of places) leave.unshift(await widget.render({ model, el: document.getElementById(place) }));
    window.widgets.push({ model, leave });
  }
}"""


@pytest.fixture(scope="module")
def host():
    with chromium() as browser:
        shown = browser.new_page(viewport={"width": 900, "height": 1700}, color_scheme="dark")
        shown.set_default_timeout(PATIENCE)
        bundle = static_files()["bench.js"]
        shown.route("http://host/", lambda route: route.fulfill(body=PAGE, content_type="text/html"))
        shown.route(
            "http://host/bench.js", lambda route: route.fulfill(body=bundle, content_type="text/javascript")
        )
        yield shown


@pytest.fixture
def page(host):
    errors = []
    host.on("pageerror", lambda error: errors.append(str(error)))
    host.goto("http://host/")
    host.evaluate(HOST)
    for place in ("one", "two", "other"):
        host.locator(f'#{place} section.picture[aria-busy="false"]').wait_for()
    yield host
    assert errors == []


def sent(page, widget):
    return page.evaluate("n => window.widgets[n].model.sent.map((each) => each.do)", widget)


def colour(page, place, pixel):
    """Of the picture, a share of the canvas from its left."""
    return page.locator(f"#{place} canvas").evaluate(
        "(c, share) => [...c.getContext('2d').getImageData(share * c.width, c.height / 2, 1, 1).data]", pixel
    )


def test_two_cells_share_what_one_widget_has_and_another_widget_is_its_own(page):
    assert sent(page, 0) == ["hello"]
    for place in (
        "one",
        "two",
        "other",
    ):  # black on the left, nothing (white) on the right; bytes that begin at 13
        assert max(colour(page, place, 0.3)[:3]) < 60
    page.locator('#one [data-part="sensor"]').focus()
    page.keyboard.press("ArrowRight")
    page.locator('#two [data-part="sensor"][aria-valuetext="52.1 mm"]').wait_for()
    assert page.locator('#other [data-part="sensor"]').get_attribute("aria-valuetext") == "52 mm"
    assert set(sent(page, 1)) == {"hello"}


def test_keys_of_the_bench_stay_in_it_and_commands_of_the_notebook_get_out(page):
    for place in ("[data-part=sensor]", "#sensor-z", "canvas", "[role=tab]"):
        page.locator(f"#one {place}").first.focus()
        for key in ("a", "d", "Delete", "Backspace", "ArrowDown", "Enter", "Control+z", "Control+a", "Control+v"):
            page.keyboard.press(key)
    assert set(page.evaluate("window.keys")) <= {"Control"}  # the modifier itself does nothing
    page.locator("#one canvas").focus()
    page.evaluate("() => { window.keys = [] }")
    for key in ("Control+s", "Shift+Enter", "Escape"):
        page.keyboard.press(key)
    assert {"s", "Enter", "Escape"} <= set(page.evaluate("window.keys"))


def test_looks_are_its_own_but_light_or_dark_is_as_around_it(page):
    frame = page.locator("#one vcc-bench")
    looks = """f => {
        const view = f.shadowRoot.firstElementChild, type = getComputedStyle(view.shadowRoot.querySelector("h1"));
        return [type.fontStyle, type.letterSpacing, type.fontSize, getComputedStyle(view).backgroundColor] }"""
    # the heading is set a little closer by its own style
    assert frame.evaluate(looks) == ["normal", "-0.13px", "13px", "rgb(251, 251, 249)"]
    assert page.locator("#one").get_by_role("button", name="Undo").is_visible()
    assert page.evaluate("getComputedStyle(document.querySelector('p')).fontStyle") == "italic"
    page.evaluate("document.body.style.color = 'oklch(0.95 0 0)'")
    page.wait_for_function(
        "getComputedStyle(document.querySelector('#one vcc-bench').shadowRoot.firstElementChild).backgroundColor"
        " === 'rgb(23, 25, 27)'"
    )


def test_it_says_when_python_does_not_answer_and_goes_on_when_it_does(page):
    page.evaluate("""() => { const model = window.widgets[0].model; window.send = model.send;
        model.send = () => { throw Error('the kernel is gone') } }""")
    page.locator('#one [data-part="sensor"]').focus()
    page.keyboard.press("ArrowRight")
    said = page.locator("#two").get_by_text("Python does not answer")
    said.wait_for()
    page.evaluate("""() => { const model = window.widgets[0].model; model.send = window.send;
        for (const each of model.handlers) each({is: 'heard'}) }""")
    said.wait_for(state="detached")


def test_what_left_the_page_and_came_back_shows_what_is_so_now(page):
    assert page.locator("#two > div").bounding_box()["height"] == 520  # parts beside the picture
    page.evaluate("window.cell = document.getElementById('two'); window.cell.remove()")
    page.locator('#one [data-part="sensor"]').focus()
    page.keyboard.press("ArrowRight")
    page.locator('#one [data-part="sensor"][aria-valuetext="52.1 mm"]').wait_for()
    page.evaluate("window.cell.style.width = '500px'; document.body.append(window.cell)")
    page.locator('#two [data-part="sensor"][aria-valuetext="52.1 mm"]').wait_for()
    page.wait_for_function("""() => { let c; const find = (root) => { for (const e of root.querySelectorAll("*")) {
        if (e.matches("canvas")) c = e; if (e.shadowRoot) find(e.shadowRoot) } };
        find(document.getElementById("two")); return c && Math.abs(c.width - 498) < 3 }""")
    assert page.locator("#two > div").bounding_box()["height"] > 1000  # below one another, and nothing to scroll


def test_ended_it_leaves_nothing(page):
    page.evaluate("async () => { for (const { leave } of window.widgets) for (const each of leave) await each() }")
    assert page.locator("vcc-bench").count() == 0
    assert page.evaluate("window.widgets.map(({ model }) => model.handlers.size)") == [0, 0]
    assert page.evaluate("['one', 'two', 'other'].map((id) => document.getElementById(id).innerHTML)") == [
        "",
        "",
        "",
    ]
