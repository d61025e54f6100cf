"""``vcc bench``: the optical bench in a browser."""

import contextlib
import dataclasses
import threading
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.base import units
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.base.units import short
from vcc.bench.cameras import SCENE, cameras, scenes
from vcc.bench.document import Document
from vcc.bench.editing import Editing
from vcc.bench.imaging import Imaging
from vcc.bench.offered import Field, Offered
from vcc.bench.picture import COARSER
from vcc.bench.published import Gallery, title_of
from vcc.bench.server import LOOPBACK, run
from vcc.bench.splat_views import SplatViews
from vcc.bench.starting import presets
from vcc.camera_file import load_camera
from vcc.cli.console import show
from vcc.cli.options import Reading, Whole, given_options
from vcc.cli.synth.splats import Standing, show_left_out
from vcc.files.camera_reading import Beside, read_tables, train_of_tables
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.sources.splats import SplatScene, read_splats
from vcc.sources.splats.reading import SPLAT_ENDINGS
from vcc.store import is_store


def bench(
    camera: Annotated[Path | None, Parameter(help="The camera file, .toml. Default: a lens of 50 mm.")] = None,
    light_field: Annotated[
        Path | None, Parameter(help="A folder of views, a file or a store. Default: the demo's scene.")
    ] = None,
    /,
    *,
    host: Annotated[str, Parameter(metavar="ADDRESS")] = LOOPBACK,
    port: Whole = 0,
    no_browser: bool = False,
    gallery: Annotated[str | None, Parameter(metavar="NAME")] = None,
    reading: Reading = Reading(),
    standing: Standing = Standing(),
) -> None:
    """Open the optical bench in the browser: move elements and see the image change.

    Without a camera and a light field it opens a lens before the demo's scene.

    A scene of Gaussian splats (.ply, .splat, .spz, .glb) is rendered in few coarse views at first, and then
    in 9×9 views of 320 pixels along the longer side. Without a camera, the lens focuses in the middle of its
    depth.

    Examples:
        vcc bench
        vcc bench --gallery plenoptic
        vcc bench camera.toml views/
        vcc bench room.ply

    Args:
        host: The address to listen on. With any other than this machine's own, other machines can connect;
            they need the token in the printed address.
        port: The port to listen on; 0 selects a free one.
        no_browser: Print the address without opening a browser.
        gallery: Start with a published camera of the gallery, such as plenoptic; vcc gallery lists their names.
    """
    fields = scenes()
    name = SCENE
    if camera is not None and light_field is None and camera.suffix.lower() in SPLAT_ENDINGS:
        camera, light_field = None, camera
    if light_field is not None:
        if not light_field.expanduser().exists():
            raise InputError(f"there is no light field {light_field}")
        name = light_field.expanduser().resolve().name or str(light_field)
    of_splats = light_field is not None and light_field.suffix.lower() in SPLAT_ENDINGS
    if not of_splats and (wrong := given_options(standing)):
        raise InputError(f"{', '.join(wrong)}: for a scene of Gaussian splats, {', '.join(SPLAT_ENDINGS)}")
    if of_splats and (wrong := given_options(reading)):
        raise InputError(f"{name} is a scene of Gaussian splats, which is rendered: leave out {', '.join(wrong)}")
    shown = Gallery(cameras(SCENE), SCENE)
    if camera is None:
        first = next(iter(shown)) if gallery is None else title_of(gallery)
        start, beside = dataclasses.replace(shown[first], light_field=name), Beside(Path(), frozenset())
    elif gallery is not None:
        raise InputError("give a camera file or --gallery NAME, not both")
    else:
        start, beside = _document(camera, name)
    if light_field is not None and of_splats:
        field, focus = _splats(light_field, standing, start.train(beside).train)
        fields = {name: field, **fields}
        if camera is None and gallery is None:
            sensor = {**start.camera["sensor"], "focus": units.text(focus, "length")}
            start = dataclasses.replace(start, camera={**start.camera, "sensor": sensor}).settled(beside)
    elif light_field is not None:
        fields = {name: _field(light_field, reading), **fields}
    offered = Offered(fields, start, beside, shown, presets(shown))
    threading.Thread(target=_prepared, args=(offered,), daemon=True).start()
    if run(offered, host=host, port=port, browser=not no_browser, say=show):
        raise SystemExit  # by Ctrl-C, without waiting for what other threads compute


def _document(camera: Path, light_field: str) -> tuple[Document, Beside]:
    """The document of a camera file, and the files that it names: only these may be read."""
    load_camera(camera)  # its errors contain the file's name
    file = camera.expanduser()
    tables, seen = read_tables(file), Beside(file.parent)
    train_of_tables(tables, seen)
    beside = Beside(file.parent, frozenset(seen.opened))
    return Document(tables, light_field).settled(beside), beside


def _field(path: Path, reading: Reading) -> Field:
    def opened(progress: Progress | None) -> LightField:
        return reading.in_memory(path)

    named = "".join(f", {key}={value!r}" for key, value in reading.given().items())
    place = repr(str(path.expanduser().resolve()))
    if is_store(path):
        return Field(opened, f"light_field = vcc.store.open_store({place}).read()")
    return Field(opened, f"light_field = vcc.open_light_field({place}{named})")


def _splats(path: Path, standing: Standing, train: Train) -> tuple[Field, float]:
    """The views of a scene of splats for a camera, and the distance at which they converge, metres."""
    cloud = read_splats(path)
    viewpoint, _ = standing.viewpoint(cloud)
    scene = SplatScene(cloud, viewpoint)
    show_left_out(scene)
    views = SplatViews.before(train, scene)
    show(f"views converge at {short(views.focus_distance, digits=3)}")
    return views.field(str(path.expanduser().resolve())), float(f"{views.focus_distance:.4g}")


def _prepared(offered: Offered) -> None:
    """Open the light field, and make a first image, which loads compiled code, while the browser starts.

    A client that is faster waits for both.
    """
    with contextlib.suppress(Exception):  # a client that needs it tries again, and gets the error
        Imaging(Editing(offered), lambda: None).take(COARSER[0])
