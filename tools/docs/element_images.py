"""The pictures of docs/elements: each function draws one element's picture and its small one for the index."""

from __future__ import annotations

import runpy
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import panels
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as Outline
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

import vcc
from vcc.files.pictures import auto_exposure
from vcc.files.transfer import encode
from vcc.optics.prescription import Prescription, Surface
from vcc.plot import plot_element, style
from vcc.plot.tracing import trace
from vcc.showcase.scene import FAR, MIDDLE, NEAR, Chart, Foliage, demo_scene
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Painting
from vcc.surfaces import Axicon, Cubic, Rough, Zernike
from vcc.units import mm, nm, um

Array = NDArray[Any]
HERE = panels.DOCS
SMALL = 1.28
"""Side of the index's pictures, inches."""

FOCAL_LENGTH = 50 * mm
PIXELS, FIELD = 360, 0.4
"""Of the shared light field: pixels a side, and the slopes that they span."""


def main(folder: Path = HERE / "images" / "elements") -> None:
    """Draw all of them."""
    (folder / "small").mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWINGS.items():
        figure, small = draw()
        figure.savefig(folder / f"{name}.png", facecolor="white")
        small.savefig(folder / "small" / f"{name}.png", facecolor="white")


# --- shared ---


def small_axes() -> tuple[Figure, Axes]:
    """A figure for the index, all of it one picture."""
    figure = Figure(figsize=(SMALL, SMALL), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    return figure, axes


def small_picture(values: Array) -> Figure:
    """A square of an upright picture, as it comes."""
    figure, axes = small_axes()
    axes.imshow(values, interpolation="antialiased", aspect="auto")
    return figure


@cache
def light_field() -> vcc.LightField:
    """Leaves at 0.8 m, a chart at 1.3 m, a town at 3 m, over an aperture of 19.5 mm."""
    return demo_scene().light_field(
        (13, 13), (PIXELS, PIXELS), spacing=1.5 * mm, slope_per_pixel=FIELD / PIXELS, focus_distance=MIDDLE
    )


def focused(distance: float) -> float:
    """Where the lens of `FOCAL_LENGTH` brings a distance to a point."""
    return 1 / (1 / FOCAL_LENGTH - 1 / distance)


def camera(distance: float, *elements: vcc.Element, diameter: float = 14 * mm, width: float = FIELD) -> vcc.Camera:
    """A lens focused on a distance with other elements, its sensor as fine as the views."""
    z = focused(distance)
    pixels = round(PIXELS * width / FIELD)
    lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter)
    return vcc.Camera([lens, *elements], vcc.Sensor(z=z, shape=(pixels, pixels), pitch=FIELD / PIXELS * z))


def shown(image: vcc.Image, exposure: float | None = None) -> Array:
    """An upright picture as screens want it, 8 bits."""
    values = image.upright().to_numpy()
    return encode(values * np.float32(auto_exposure(values) if exposure is None else exposure), 8)


def picture(axes: Axes, values: Array, title: str, pitch: float | None = None, bar: float = 2 * mm) -> None:
    """An upright picture without axes; with the pixels' pitch on the sensor, a bar of known length."""
    interpolation = "antialiased" if values.shape[0] > 150 else "nearest"
    panels.picture(axes, values, title, style.TITLE, style.INK, interpolation=interpolation)
    if pitch is None:
        return
    rows, columns = values.shape[:2]
    left, bottom, length = 0.05 * columns, 0.94 * rows, bar / pitch
    for colour, width in (("black", 5), ("white", 2.5)):
        axes.plot([left, left + length], [bottom, bottom], color=colour, lw=width, solid_capstyle="butt")
    axes.text(
        left, bottom - 0.025 * rows, f"{bar / mm:g} mm" if bar >= mm else f"{bar / um:g} µm",
        color="white", fontsize=style.SMALL, va="bottom", path_effects=outlined(),
    )  # fmt: skip


def outlined() -> list[Any]:
    """White letters that can be read on anything."""
    from matplotlib import patheffects

    return [patheffects.withStroke(linewidth=2.5, foreground="black")]


def magnified(axes: Axes, whole: Axes, values: Array, corner: tuple[int, int], size: int, title: str) -> None:
    """A square of a picture, pixel by pixel, and a frame around it in the whole picture."""
    row, column = corner
    axes.imshow(values[row : row + size, column : column + size], interpolation="nearest")
    axes.set_title(title, fontsize=style.TITLE, color=style.INK)
    axes.set(xticks=(), yticks=())
    axes.spines[:].set(color=style.ORANGE, linewidth=2)
    whole.add_patch(Rectangle((column, row), size, size, fill=False, ec=style.ORANGE, lw=2))


# --- lens, prism, mask ---


def lens() -> tuple[Figure, Figure]:
    """From the side, and two pictures by the same lens."""
    figure = panels.new_figure(11, 3.9)
    side, near, far = figure.subplots(1, 3, width_ratios=(1.1, 1, 1))
    plotted(side, camera(NEAR), (NEAR, 0.25))
    pictures = [shown(camera(distance).capture(light_field())) for distance in (NEAR, FAR)]
    pitch = FIELD / PIXELS * focused(NEAR)
    picture(near, pictures[0], "focused on the leaves, 0.8 m", pitch)
    picture(far, pictures[1], "focused on the town, 3 m", pitch)
    return figure, small_picture(pictures[0][60:240, 20:200])


def plotted(axes: Axes, drawn: vcc.Camera, distances: tuple[float, ...], **options: Any) -> None:
    """A camera from the side, as `Camera.plot` draws it."""
    drawn.plot(axes=axes, object_distances=distances, **options)


def prism() -> tuple[Figure, Figure]:
    """From the side, and the picture that it moves."""
    wedge = vcc.Prism(deflection=(0.04, 0.0), z=10 * mm)
    figure = panels.new_figure(11, 3.9)
    side, without, through = figure.subplots(1, 3, width_ratios=(1.1, 1, 1))
    plotted(side, camera(MIDDLE, wedge), (MIDDLE,))
    white = auto_exposure(camera(MIDDLE).capture(light_field()).to_numpy())
    pictures = [
        shown(camera(MIDDLE, *elements, width=0.3).capture(light_field()), white) for elements in ((), (wedge,))
    ]
    pitch = FIELD / PIXELS * focused(MIDDLE)
    picture(without, pictures[0], "without", pitch)
    picture(through, pictures[1], "with the prism, δs = 0.04", pitch)
    moved = 0.04 * (focused(MIDDLE) - 10 * mm) / pitch
    for axes, place in ((without, 75), (through, 75 - moved)):
        axes.axvline(place, color=style.ORANGE, lw=1.6)
    small, axes = small_axes()
    axes.add_patch(Outline([(0.42, 0.15), (0.58, 0.15), (0.5, 0.92)], fc=style.GLASS, ec=style.GLASS_EDGE, lw=1.5))
    for height in (0.3, 0.45, 0.6, 0.75):
        axes.plot([0, 0.5, 1], [height, height, height - 0.16], color=style.BLUE, lw=1.5)
    axes.set(xlim=(0, 1), ylim=(0, 1))
    return figure, small


def mask() -> tuple[Figure, Figure]:
    """A coded aperture in the lens seen in lamps out of focus, and a mask before the sensor."""
    coded = vcc.Mask(vcc.patterns.mura(7), width=14 * mm)
    cosine = vcc.Mask(vcc.patterns.CosineSum(period=1.6 * mm), width=40 * mm, z=46 * mm)
    figure = panels.new_figure(11, 3.3)
    sheet, clear, through, late = figure.subplots(1, 4)
    grid = (np.arange(280) + 0.5) / 280 * 14 * mm - 7 * mm
    sheet.imshow(coded.faces().pattern(grid[None, :], grid[:, None]), cmap="gray", extent=(-7, 7, 7, -7))
    sheet.set_title("modified URA of 7×7 cells", fontsize=style.TITLE, color=style.INK)
    style.tidy(sheet, "x [mm]", "y [mm]")
    sheet.set(xticks=(-5, 0, 5), yticks=(-5, 0, 5))
    z = focused(NEAR)
    sensor = vcc.Sensor(z=z, shape=(240, 240), pitch=4e-4 * z)
    lamps = lamps_light_field()
    pictures = []
    for diameter, elements in ((14 * mm, ()), (20 * mm, (coded,))):
        taken = vcc.Camera([vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter), *elements], sensor)
        pictures.append(shown(taken.capture(lamps)))
    picture(clear, pictures[0], "lamps behind the focus", sensor.pitches[0], 1 * mm)
    picture(through, pictures[1], "with the mask in the lens", sensor.pitches[0], 1 * mm)
    heterodyne = shown(camera(MIDDLE, cosine).capture(light_field()))
    picture(late, heterodyne, "cosine mask near the sensor", FIELD / PIXELS * focused(MIDDLE))
    return figure, small_picture(pictures[1][6:106, 6:106])


def angle_filter() -> tuple[Figure, Figure]:
    """A louvre from the side, transmissions against the angle, and images through both elements."""
    louvre = vcc.Louvre(pitch=0.5 * mm, height=1.6 * mm, wall=0.05 * mm, z=46 * mm)
    fringes = vcc.AngleFilter(vcc.patterns.AngularFringes(frequency=60), z=46 * mm)
    figure = panels.new_figure(11, 3.0)
    side, curve, through, striped = figure.subplots(1, 4, width_ratios=(1, 1, 1.1, 1.1))
    plot_element(louvre, axes=side)
    angles = np.radians(np.linspace(-20, 20, 401))
    rays = np.zeros((2000, 4))
    rays[:, 0] = (np.arange(2000) + 0.5) / 2000 * louvre.pitch
    for element, name, colour in ((louvre, "louvre", style.BLUE), (fringes, "fringes, β = 60", style.ORANGE)):
        (term,) = element.faces().terms
        shares = []
        for angle in angles:
            rays[:, 2] = np.tan(angle)
            shares.append(term.share(rays).mean())
        curve.plot(np.degrees(angles), shares, color=colour, lw=1.4, label=name)
    curve.legend(fontsize=style.SMALL, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 0.98), ncols=2)
    style.tidy(curve, "angle of incidence [°]", "mean transmission")
    curve.set_ylim(0, 1.05)
    narrow = 4 * mm  # of the lens: at wide ones a pixel averages over many angles
    white = auto_exposure(camera(MIDDLE, diameter=narrow).capture(light_field()).to_numpy())
    pitch = FIELD / PIXELS * focused(MIDDLE)
    pictures = [
        shown(camera(MIDDLE, element, diameter=narrow).capture(light_field(), samples=rays), white)
        for element, rays in ((louvre, 256), (fringes, None))
    ]
    picture(through, pictures[0], "through the louvre", pitch)
    picture(striped, pictures[1], "through the fringes", pitch)
    small, axes = small_axes()
    for height in (0.1, 0.36, 0.62, 0.88):
        axes.plot([0.35, 0.65], [height, height], color="black", lw=2.5)
    for height, slope, end in ((0.23, 0.0, 1.0), (0.49, 0.12, 1.0), (0.62, -0.7, 0.55), (0.95, -0.9, 0.44)):
        axes.plot([0, end], [height - slope * 0.5, height + slope * (end - 0.5)], color=style.BLUE, lw=1.5)
    axes.set(xlim=(0, 1), ylim=(0, 1))
    return figure, small


def lamps_light_field() -> vcc.LightField:
    """A twig at 0.8 m before small bright lamps at 3 m, narrower and finer than `light_field`."""

    def lamps(x: Array, y: Array) -> Array:
        painting = Painting(x, y)
        painting.rectangle((-1, -1, 1, 1), (0.03, 0.035, 0.08), 1 * mm)
        random = np.random.default_rng(5)
        colours = ((1.0, 0.8, 0.42), (1.0, 0.25, 0.12), (0.35, 0.85, 1.0), (0.55, 1.0, 0.45))
        for n, (column, row) in enumerate(np.ndindex(5, 5)):
            place = (np.array([column, row]) - 2 + random.uniform(-0.3, 0.3, 2)) * 62 * mm
            painting.disc((float(place[0]), float(place[1])), 3 * mm, 22 * np.array(colours[n % 4]), 1 * mm)
        return painting.values

    scene = PlanesScene([TexturedPlane(Foliage(), NEAR, middle=(0.185, -0.01)), TexturedPlane(lamps, FAR)])
    return scene.light_field(
        (17, 17), (260, 260), spacing=0.85 * mm, slope_per_pixel=4e-4, focus_distance=NEAR, dtype=np.float32
    )


# --- diffusers ---


def diffuser() -> tuple[Figure, Figure]:
    """The scene through clear glass, a Gaussian and a coded diffuser, and the map of the last."""
    y, x = np.mgrid[-1:1:81j, -1:1:81j]
    sigma = 0.05 * np.clip(np.hypot(x, y) - 0.22, 0, None) ** 1.2
    coded = vcc.CodedDiffuser(vcc.kernels.Gaussian(1.0), width=20 * mm, widths=sigma, z=36 * mm)
    plain = vcc.Diffuser(vcc.kernels.Gaussian(0.012), z=36 * mm)
    figure = panels.new_figure(8.6, 8.2)
    (clear, even), (sheet, varied) = figure.subplots(2, 2)
    pictures = [
        shown(camera(MIDDLE, *elements, diameter=8 * mm, width=0.34).capture(light_field(), **options), 1 / 0.0145)
        for elements, options in (((), {}), ((plain,), {}), ((coded,), {"samples": 2048}))
    ]
    pitch = FIELD / PIXELS * focused(MIDDLE)
    picture(clear, pictures[0], "without a diffuser", pitch)
    picture(even, pictures[1], "Gaussian, σ = 0.012", pitch)
    drawn = sheet.imshow(1e3 * sigma, extent=(-10, 10, 10, -10), cmap="viridis")
    bar = figure.colorbar(drawn, ax=sheet, shrink=0.75, pad=0.02)
    bar.ax.tick_params(labelsize=style.SMALL)
    bar.set_label("σ [0.001]", fontsize=style.TEXT, color=style.INK)
    sheet.set_title("the map of a coded diffuser", fontsize=style.TITLE, color=style.INK)
    style.tidy(sheet, "x [mm]", "y [mm]")
    sheet.set(xticks=(-10, -5, 0, 5, 10), yticks=(-10, -5, 0, 5, 10))
    picture(varied, pictures[2], "through it, in the same place", pitch)
    return figure, small_picture(pictures[2][60:300, 0:240])


# --- phase plates ---


def spots(elements: list[vcc.Element], z: float, x: Array, y: Array) -> Array:
    """Where parallel light through places (x, y) of the opening meets a sensor at z, µm, (rays, 2)."""
    drawn = vcc.Camera(elements, vcc.Sensor(z=z, shape=(9, 9), pitch=0.1 * mm))
    return np.asarray(trace(drawn, np.stack([x, y, 0 * x, 0 * x], axis=-1)).positions[:, -1] / um)


def even_square(width: float, rays: int = 5000) -> tuple[Array, Array]:
    """Places spread evenly over a square, by Roberts' sequence R₂."""
    places = (np.arange(rays)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]) + 0.5) % 1
    return width * (places[:, 0] - 0.5), width * (places[:, 1] - 0.5)


def rings(diameter: float, number: int = 14, each: int = 240) -> tuple[Array, Array]:
    """Places on circles of equal distance."""
    radius = np.repeat((np.arange(number) + 1) / number, each) * diameter / 2
    angle = np.tile(np.arange(each) * 2 * np.pi / each, number)
    return radius * np.cos(angle), radius * np.sin(angle)


def spot_axes(axes: Axes, places: Array, colour: str, title: str, middle: float, reach: float) -> None:
    """A spot diagram, y down as everywhere."""
    axes.plot(*places.T, ".", ms=1.6, mew=0, color=colour, rasterized=True)
    axes.set(xlim=(middle - reach, middle + reach), ylim=(middle + reach, middle - reach), aspect="equal")
    axes.set_title(title, fontsize=style.TEXT, color=style.INK)
    axes.tick_params(labelsize=9, colors=style.INK)
    axes.spines[["top", "right"]].set_visible(False)


def phase_plate() -> tuple[Figure, Figure]:
    """Spots of a lens alone and with a cubic plate through focus; and of other plates in focus."""
    diameter = 10 * mm
    alone: list[vcc.Element] = [vcc.Lens(FOCAL_LENGTH, diameter=15 * mm)]
    cubic = [*alone, vcc.PhasePlate(Cubic.from_alpha(90, half_width=5 * mm, wavelength=550 * nm), width=diameter)]
    figure = panels.new_figure(10.5, 6.9)
    grid = figure.subplots(3, 5)
    square = even_square(diameter)
    for column, defocus in enumerate((-1.0, -0.5, 0.0, 0.5, 1.0)):
        z = FOCAL_LENGTH + defocus * mm
        title = f"{defocus:+g} mm".replace("-", "−") if defocus else "in focus"
        spot_axes(grid[0, column], spots(alone, z, *square), style.BLUE, title, 0, 210)
        spot_axes(grid[1, column], spots(cubic, z, *square), style.ORANGE, "", 180, 210)
        grid[1, column].set_xlabel("x [µm]", fontsize=style.SMALL, color=style.INK)
    disc = rings(diameter)
    several = np.hypot(*square) < diameter / 2
    others = [
        ("axicon", Axicon(0.002), disc),
        ("coma, Z₈", Zernike.from_terms({8: 1 * um}, diameter=diameter), disc),
        ("trefoil, defocus", Zernike.from_terms({4: 1 * um, 10: 0.7 * um}, diameter=diameter), disc),
        ("spherical, Z₁₁", Zernike.from_terms({11: 1 * um}, diameter=diameter), disc),
        ("rough", Rough(1 * um, correlation_length=0.6 * mm, width=diameter, seed=3),
         (square[0][several], square[1][several])),
    ]  # fmt: skip
    for axes, (title, surface, where) in zip(grid[2], others, strict=True):
        places = spots([*alone, vcc.PhasePlate(surface)], FOCAL_LENGTH, *where)
        low, high = places.min(), places.max()
        middle = (low + high) / 2 if title.startswith("coma") else 0.0
        spot_axes(axes, places, style.GREEN, title, middle, 1.12 * np.abs(places - middle).max())
        axes.set_xlabel("x [µm]", fontsize=style.SMALL, color=style.INK)
    for row, words in zip(grid, ("lens alone", "with a cubic plate", "others, in focus"), strict=True):
        row[0].set_ylabel(f"{words}\ny [µm]", fontsize=style.TEXT, color=style.INK)
    small, axes = small_axes()
    spot_axes(axes, spots(cubic, FOCAL_LENGTH, *square), style.ORANGE, "", 120, 150)
    return figure, small


# --- arrays ---


def plenoptic(array: vcc.LensArray, sensor_z: float, diameter: float) -> vcc.Camera:
    """A main lens, the array and a sensor of 600×600 pixels of 20 µm."""
    main_lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter)
    return vcc.Camera([main_lens, array], vcc.Sensor(z=sensor_z, shape=(600, 600), pitch=20 * um))


def lens_array() -> tuple[Figure, Figure]:
    """From the side; the scene, the raw picture, and micro-images of three arrays."""
    pitch, length = 280 * um, 1.12 * mm
    z = focused(NEAR)
    plain = [
        plenoptic(
            vcc.LensArray(pitch=pitch, focal_length=length, layout=layout, z=z, circular=layout == "hexagonal"),
            z + length,
            pitch * (z + length) / length,
        )
        for layout in ("square", "hexagonal")
    ]
    # 0.8, 1.3 and 3 m are each sharp by one kind of lenslet; all relay to one sensor.
    array_z, behind = 55.4 * mm, 1.5 * mm
    lengths = tuple(1 / (1 / (array_z - focused(distance)) + 1 / behind) for distance in (NEAR, MIDDLE, FAR))
    multi = vcc.LensArray(pitch=pitch, focal_length=lengths, layout="hexagonal", circular=True, z=array_z)
    cameras = [*plain, plenoptic(multi, array_z + behind, pitch * (array_z + behind) / behind)]
    raw = [shown(one.capture(light_field(), samples=256)) for one in cameras]
    scene = shown(camera(MIDDLE, diameter=10 * mm, width=0.23).capture(light_field()))

    figure = panels.new_figure(10.5, 10.8)
    above, below = figure.subfigures(2, 1, height_ratios=(3.5, 7.3))
    side = above.subplots()
    coarse = vcc.LensArray(pitch=2 * mm, focal_length=8 * mm, z=z, width=14 * mm)
    # Micro-images just touch: b/p = (d + b)/D.
    plotted(side, plenoptic(coarse, z + 8 * mm, (z + 8 * mm) / 4), (NEAR, 0.16), rays=16)
    legend = side.get_legend()
    if legend is not None:  # these axes are low, and it would lie over their label
        legend.set_bbox_to_anchor((0.5, -0.24), transform=side.transAxes)
    grid = below.subplots(2, 3)
    picture(grid[0, 0], scene, "the scene", FIELD / PIXELS * focused(MIDDLE))
    picture(grid[0, 1], raw[0], "plenoptic 1.0, square lenslets", 20 * um)
    magnified(grid[0, 2], grid[0, 1], raw[0], (32, 8), 112, "8×8 of its micro-images")
    picture(grid[1, 0], raw[2], "2.0, three focal lengths", 20 * um)
    magnified(grid[1, 1], grid[1, 0], raw[2], (372, 356), 112, "each third lenslet is sharp")
    magnified(grid[1, 2], grid[0, 1], raw[1], (32, 8), 112, "1.0, hexagonal, round lenslets")
    return figure, small_picture(raw[0][32:122, 8:98])


def prism_array() -> tuple[Figure, Figure]:
    """Nine lenses with prisms: nine views of the scene, side by side on one sensor."""
    focal, pitch = 30 * mm, 6 * mm
    behind = 1 / (1 / focal - 1 / MIDDLE)
    apart = 9.4 * mm
    place = (np.arange(3) - 1) * (apart - pitch) / behind
    slopes = np.stack(np.meshgrid(place, place), axis=-1)
    array = vcc.PrismArray(slopes, pitch=pitch, focal_length=focal)
    pixels = 840
    sensor = vcc.Sensor(z=behind, shape=(pixels, pixels), pitch=3 * apart / pixels)
    narrow = light_field()[:, :, 42:318, 42:318]
    with warnings.catch_warnings():  # each cell sees all of the sensor, and its view fills a ninth of it
        warnings.simplefilter("ignore", vcc.ResultWarning)
        raw = shown(vcc.Camera([array], sensor).capture(narrow, samples=256))
    figure = panels.new_figure(11, 4.3)
    side, whole, pair = figure.subplots(1, 3, width_ratios=(1.1, 1.15, 0.6))
    plotted(side, vcc.Camera([array], sensor), (MIDDLE, 0.2), rays=19)
    picture(whole, raw, "one recording: nine views, 6 mm apart", 3 * apart / pixels, 5 * mm)
    third, size = pixels // 3, 84
    corner = (third + 20, 22)
    # Views are inverted each for itself: upright, the leftmost view is that of the leftmost cell.
    left, right = (
        raw[corner[0] : corner[0] + size, n * third + corner[1] : n * third + corner[1] + size] for n in (0, 2)
    )
    for n in (0, 2):
        whole.add_patch(
            Rectangle((n * third + corner[1], corner[0]), size, size, fill=False, ec=style.ORANGE, lw=2)
        )
    both = np.concatenate([left, np.full((5, size, 3), 255, np.uint8), right])
    panels.picture(pair, both, "left and right view", style.TITLE, style.INK, interpolation="nearest")
    return figure, small_picture(raw)


# --- biprism, pyramid ---


def biprism() -> tuple[Figure, Figure]:
    """From the side; the picture; how far apart the two pictures of points are, measured and in closed form."""
    delta, a, d = 0.03, 60 * mm, 52 * mm
    element = vcc.Biprism(deflection=delta)
    main_lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=6 * mm, z=a)
    sensor = vcc.Sensor(z=a + d, shape=(240, 450), pitch=40 * um)
    taken = vcc.Camera([element, main_lens], sensor)
    wide = demo_scene().light_field(
        (11, 21), (300, 520), spacing=1.5 * mm, slope_per_pixel=FIELD / PIXELS, focus_distance=MIDDLE
    )
    values = shown(taken.capture(wide))
    figure = panels.new_figure(11, 3.8)
    side, seen, curve = figure.subplots(1, 3, width_ratios=(1.25, 1.2, 0.9))
    plotted(side, taken, (0.25,), rays=14)
    side.set_yticks([-10, -5, 0, 5, 10])
    picture(seen, values, "the picture", 40 * um)
    distance = np.geomspace(0.15, 5, 200)
    curve.semilogx(distance, 2 * delta * distance * d / (distance + a) / mm, color=style.BLUE, lw=1.5)
    measured = [(z, separation(taken, z) / mm) for z in (0.2, 0.4, 0.8, 1.6, 3.2)]
    curve.plot(*zip(*measured, strict=True), "o", color=style.ORANGE, ms=5)
    curve.text(0.19, 3.02, "2·δ·Z·d/(Z + a)", color=style.BLUE, fontsize=style.SMALL)
    curve.text(0.95, 2.55, "traced rays", color=style.ORANGE, fontsize=style.SMALL)
    curve.set_xticks([0.2, 0.5, 1, 2, 5], ["0.2", "0.5", "1", "2", "5"])
    curve.minorticks_off()
    curve.set_title("how far apart", fontsize=style.TITLE, color=style.INK)
    style.tidy(curve, "distance Z of the point [m]", "between its pictures [mm]")
    return figure, small_picture(values[20:220, 130:330])


def separation(drawn: vcc.Camera, distance: float) -> float:
    """Between the two pictures of a point on the axis: where rays through the lens's middle land."""
    places = np.concatenate([np.linspace(-9, -0.1, 4001), np.linspace(0.1, 9, 4001)]) * mm
    rays = np.zeros((len(places), 4))
    rays[:, 0], rays[:, 2] = places, places / distance
    paths = trace(drawn, rays)
    lens_x, landed = paths.positions[:, 2, 0], paths.positions[:, 3, 0]
    ends = []
    for half in (places < 0, places > 0):
        nearest = np.argmin(np.where(half, np.abs(lens_x), np.inf))
        ends.append(landed[nearest])
    return float(abs(ends[1] - ends[0]))


def pyramid() -> tuple[Figure, Figure]:
    """One picture a facet: three, four and six."""
    away = 4.2
    board = PlanesScene([TexturedPlane(Chart(), away)]).light_field(
        (13, 13), (PIXELS, PIXELS), spacing=1.5 * mm, slope_per_pixel=FIELD / PIXELS, focus_distance=away
    )
    figure = panels.new_figure(10.5, 3.9)
    pictures = []
    for axes, (sides, turn) in zip(figure.subplots(1, 3), ((3, np.pi / 2), (4, np.pi / 4), (6, 0)), strict=True):
        facets = vcc.Pyramid(sides=sides, deflection=0.075, rotation=turn)
        values = shown(camera(away, facets, diameter=16 * mm, width=0.245).capture(board, samples=512))
        picture(axes, values, f"{sides} facets", FIELD / PIXELS * focused(away))
        pictures.append(values)
    return figure, small_picture(pictures[1])


# --- a real lens ---


def telephoto() -> Prescription:
    """A cemented doublet, a stop and a negative lens, made up for this page."""
    rows = [  # radius, thickness, index behind, diameter; millimetres
        (23.0, 5.8, 1.517, 19.0),
        (-24.0, 1.6, 1.648, 19.0),
        (-120.0, 8.0, 1.0, 19.0),
        (np.inf, 8.0, 1.0, 9.2),
        (-60.0, 1.6, 1.517, 13.0),
        (90.0, 0.0, 1.0, 13.4),
    ]
    surfaces = [
        Surface(r * mm, t * mm, n, diameter * mm, stop=bool(np.isinf(r)), number=number)
        for number, (r, t, n, diameter) in enumerate(rows, start=1)
    ]
    return Prescription(tuple(surfaces), name="telephoto")


def first_order() -> tuple[Figure, Figure]:
    """Surfaces, stop and rays of a lens, with what its matrix knows: principal planes, focus, pupils."""
    prescription = telephoto()
    system = prescription.first_order()
    figure = panels.new_figure(10.5, 4.8)
    axes = figure.subplots()
    last = prescription.length
    front, back = system.front_principal_distance, last + system.back_principal_distance
    focus = last + system.back_focal_distance
    start = min(front, back) - 8 * mm
    draw_surfaces(axes, prescription)
    draw_paraxial_rays(axes, prescription, system, start, back)
    for z, words in ((front, "H"), (back, "H′")):
        axes.plot([z / mm] * 2, [-14, 14], color=style.ORANGE, lw=1.4, ls=(0, (5, 3)))
        axes.text(z / mm, 14.6, words, ha="center", color=style.ORANGE, fontsize=style.TITLE)
    axes.plot(focus / mm, 0, "o", color=style.BLUE, ms=6)
    axes.text(focus / mm, 1.4, "F′", ha="center", color=style.BLUE, fontsize=style.TITLE)
    for pupil, end, words, side in (
        (system.entrance_pupil, 0.0, "entrance pupil", "left"),
        (system.exit_pupil, last, "exit pupil", "right"),
    ):
        z, half = (end + pupil.distance) / mm, pupil.diameter / 2 / mm
        for sign in (-1, 1):
            axes.plot([z, z], [sign * half, sign * 11.5], color=style.GREEN, lw=2.4)
        away = 0.8 if side == "left" else -0.8
        axes.text(z + away, -12.6, words, ha=side, va="center", color=style.GREEN, fontsize=style.SMALL)
    axes.text(
        (prescription.stop_distance or 0) / mm, 8.2, "stop ", ha="right", color=style.INK, fontsize=style.SMALL
    )
    axes.annotate(
        "", (back / mm, -17), (focus / mm, -17), arrowprops={"arrowstyle": "<->", "color": style.INK, "lw": 1}
    )
    axes.text(
        (back + focus) / 2 / mm, -16.6, f"f = {system.focal_length / mm:.1f} mm, f/{system.f_number:.1f}",
        ha="center", va="bottom", color=style.INK, fontsize=style.TEXT,
    )  # fmt: skip
    axes.axhline(0, color=style.QUIET, lw=0.8, ls=(0, (8, 3, 1, 3)), zorder=0)
    axes.set(xlim=(start / mm, focus / mm + 3), ylim=(-18.5, 17), aspect="equal")
    style.tidy(axes, "z [mm], light goes to the right", "y [mm]")
    small, tiny = small_axes()
    draw_surfaces(tiny, prescription)
    draw_paraxial_rays(tiny, prescription, system, start, None)
    tiny.set(xlim=(-8, 32), ylim=(-20, 20))
    return figure, small


def draw_surfaces(axes: Axes, prescription: Prescription) -> None:
    """Glasses between arcs, and the stop."""
    z = 0.0
    profiles = []
    for surface in prescription.surfaces:
        half = surface.diameter / 2 if surface.diameter else 0.0
        y = np.linspace(-half, half, 61)
        sag = (
            np.zeros_like(y)
            if np.isinf(surface.radius)
            else surface.radius - np.sign(surface.radius) * np.sqrt(surface.radius**2 - y**2)
        )
        profiles.append((z + sag, y))
        if surface.stop:
            for sign in (-1, 1):
                axes.plot([z / mm] * 2, [sign * half / mm, sign * (half / mm + 2.5)], color=style.INK, lw=3)
        z += surface.thickness
    for n, surface in enumerate(prescription.surfaces[:-1]):
        if surface.index > 1:
            (z1, y1), (z2, y2) = profiles[n], profiles[n + 1]
            outline = np.concatenate([np.stack([z1, y1], -1), np.stack([z2, y2], -1)[::-1]]) / mm
            axes.add_patch(Outline(outline, fc=style.GLASS, ec=style.GLASS_EDGE, lw=1.4, joinstyle="round"))


def draw_paraxial_rays(
    axes: Axes, prescription: Prescription, system: vcc.FirstOrder, start: float, bend: float | None
) -> None:
    """Parallel light through each surface in turn, as the matrices bend it; dashed, as if bent at one plane."""
    half = system.entrance_pupil.diameter / 2
    lines, direct = [], []
    for height in np.linspace(-half, half, 7):
        u, slope, z, before = float(height), 0.0, 0.0, 1.0
        line = [(start, u)]
        for surface in prescription.surfaces:
            line.append((z, u))
            # n′·s′ = n·s − u·(n′ − n)/R
            slope = (before * slope - u * (surface.index - before) / surface.radius) / surface.index
            before = surface.index
            if surface is not prescription.surfaces[-1]:
                u, z = u + slope * surface.thickness, z + surface.thickness
        if bend is not None and abs(height) > 0.9 * half:
            direct.append(np.array([(bend, u + slope * (bend - z)), (z, u)]) / mm)
        way = system.back_focal_distance
        line.append((z + way, u + slope * way))
        lines.append(np.array(line) / mm)
    axes.add_collection(LineCollection(lines, colors=style.BLUE, linewidths=1.1, alpha=0.85))
    axes.add_collection(LineCollection(direct, colors=style.BLUE, linewidths=1, linestyles=(0, (4, 3))))


# --- an element of one's own ---


def own_element() -> tuple[Figure, Figure]:
    """Points of light without and with the spiral plate of examples/own_element.py, and a ring's profile."""
    example = runpy.run_path(str(HERE.parent / "examples" / "own_element.py"))
    plate = example["SpiralPlate"](
        charge=20, wavelength=550 * nm, inner_diameter=4 * mm, outer_diameter=10 * mm, name="spiral"
    )
    stars = example["scene"]()
    plain = example["camera_with"]()
    with_plate = example["camera_with"](plate)
    sharp = plain.capture(stars).upright().to_numpy()
    rings_image = with_plate.capture(stars, samples=2048)
    rings = rings_image.upright().to_numpy()
    figure = panels.new_figure(11, 3.4)
    left, right, profile = figure.subplots(1, 3, width_ratios=(1.25, 1.25, 0.95))
    pitch = with_plate.sensor.pitches[0]
    pictures = [encode(values / values.max() * gain, 8) for values, gain in ((sharp, 1.5), (rings, 1.2))]
    picture(left, pictures[0], "seven points of light", pitch, 100 * um)
    picture(right, pictures[1], "through the spiral plate", pitch, 100 * um)
    rows, columns = rings.shape[:2]
    y, x = np.mgrid[:rows, :columns]
    radius = np.hypot(x - (columns - 1) / 2, y - (rows - 1) / 2) * pitch / um
    steps = np.arange(0, 39) * 2.5
    means = [rings[..., 1][(radius >= r) & (radius < r + 2.5)].mean() for r in steps]
    middle = steps + 1.25
    a = plate.charge * plate.wavelength / (2 * np.pi) * with_plate.sensor.z
    inner, outer = a / (5 * mm) / um, a / (2 * mm) / um
    rho = np.linspace(0, 97.5, 2000)
    ideal = np.where((rho > inner) & (rho < outer), np.maximum(rho, 1.0) ** -4.0, 0.0)
    # The same light in both.
    ideal *= (np.array(means) * middle).sum() * 2.5 / np.trapezoid(ideal * rho, rho)
    profile.plot(rho, ideal / ideal.max(), color=style.BLUE, lw=1.4)
    profile.plot(middle, np.array(means) / ideal.max(), "o", ms=4, color=style.ORANGE)
    profile.text(52, 0.62, "closed form, ρ⁻⁴", color=style.BLUE, fontsize=style.SMALL)
    profile.text(52, 0.5, "the middle ring", color=style.ORANGE, fontsize=style.SMALL)
    profile.set_title("across a ring", fontsize=style.TITLE, color=style.INK)
    profile.set_xlim(0, 97.5)
    style.tidy(profile, "distance ρ from its middle [µm]", "relative irradiance")
    return figure, small_picture(pictures[1][60:180, 120:240])


DRAWINGS: dict[str, Callable[[], tuple[Figure, Figure]]] = {
    "lens": lens,
    "prism": prism,
    "mask": mask,
    "angle-filter": angle_filter,
    "diffuser": diffuser,
    "phase-plate": phase_plate,
    "lens-array": lens_array,
    "prism-array": prism_array,
    "biprism": biprism,
    "pyramid": pyramid,
    "first-order": first_order,
    "own-element": own_element,
}

if __name__ == "__main__":
    main()
