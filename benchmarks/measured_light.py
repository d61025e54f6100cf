"""Recordings of real cameras beside what their published numbers predict.

    pip install ".[formats,plot]"
    python benchmarks/measured_light.py microscope FOLDER    # Radiometry_*.tif, DarkFrame_*.tif
    python benchmarks/measured_light.py dual-pixel FOLDER    # blur_kernels_*.npy, white_sheet_*.png

Where the recordings come from is on the page "Measured light" of the documentation; none of them is part of the
project. Nothing is fitted except what a line calls fitted. Prints Markdown; ``--figure FILE.png`` draws curves.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import vcc
from vcc.recover import LensletGrid
from vcc.units import mm, um

Array = NDArray[np.float64]


def main() -> None:
    """Read the arguments and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("camera", choices=sorted(CAMERAS))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--figure", type=Path, help="a PNG of the curves")
    given = parser.parse_args()
    rows, curves = CAMERAS[given.camera](given.folder)
    print("| | predicted | measured |\n|---|---|---|")
    for row in rows:
        print("| " + " | ".join(row) + " |")
    if given.figure:
        draw(curves, given.figure)


Rows = list[tuple[str, str, str]]
Curves = list[tuple[str, str, list[tuple[str, Array, Array]]]]
"""Title, label of x, and lines (name, x, y) of each panel."""


# --- a light field microscope ---

PITCH, FOCAL, PIXEL, TUBE = 100 * um, 2.5 * mm, 6.5 * um, 200 * mm
MAGNIFICATION, NA, WAVELENGTH = 60, 1.2, 593e-9
BINS = 21
"""Along a side of the mean micro-image."""


def microscope(folder: Path) -> tuple[Rows, Curves]:
    """The white image of a light field microscope (lenslets of 100 µm, NA 1.2, 60×) from its optics as stated."""
    import imagecodecs

    from vcc.recover.white_image import find_lenslets

    white, dark = (imagecodecs.imread(next(folder.glob(f"{name}_*.tif"))) for name in ("Radiometry", "DarkFrame"))
    grid = find_lenslets(white, dark=dark)
    measured = mean_micro_image(white.astype(np.float64) - dark, grid)
    predicted = predicted_micro_image(NA)
    spread = by_waves(predicted)
    smaller = NA * np.sqrt(area_above_half(measured) / area_above_half(spread))
    fitted = by_waves(predicted_micro_image(smaller))
    images = {
        "measured": measured,
        "rays": predicted,
        "rays and the lenslet's diffraction": spread,
        f"the same, NA fitted: {smaller:.2f}": fitted,
    }
    step = PITCH / BINS
    place = (np.arange(BINS) - BINS // 2) * step
    turn = np.degrees(np.arctan2(grid.steps[0][1], grid.steps[0][0]))
    disc = 2 * FOCAL * NA / MAGNIFICATION
    rows = [
        ("micro-images, pixels apart", f"{PITCH / PIXEL:.3f}", f"{grid.pitch:.3f}"),
        (
            "root mean square distance of centres from a square lattice, pixels",
            "0",
            f"{grid.residual:.3f} (turned by {turn:.2f}°)",
        ),
        (
            "diameter of a micro-image (the pupil), µm",
            f"{disc / um:.1f}",
            f"{2 * np.sqrt(area_above_half(measured) / np.pi) * step / um:.1f}",
        ),
        (
            "the same, the prediction measured alike",
            f"{2 * np.sqrt(area_above_half(spread) / np.pi) * step / um:.1f}",
            "",
        ),
        *(
            (f"correlation with the measured mean micro-image, {name}", f"{correlation(each, measured):.3f}", "1")
            for name, each in images.items()
            if name != "measured"
        ),
        ("light in a micro-image's corners over its middle", f"{corner(spread):.2f}", f"{corner(measured):.2f}"),
    ]
    middle = BINS // 2
    lines = [(name, place / um, each[middle] / top(each)) for name, each in images.items()]
    across = np.sqrt(2) * place / um
    diagonal = [(name, across, np.diag(each) / top(each)) for name, each in images.items()]
    return rows, [("Along a row", "µm", lines), ("Along the diagonal", "µm", diagonal)]


def mean_micro_image(image: Array, grid: LensletGrid) -> Array:
    """All micro-images within the recording in one, in `BINS` bins a side, each weighted to a mean of one."""
    y, x = np.mgrid[: image.shape[0], : image.shape[1]].astype(np.float64)
    place = grid.index_of(np.stack([x, y], axis=-1))
    index = np.moveaxis(np.rint(place), -1, 0)
    inside = place - np.rint(place)
    label = (index[0] - index[0].min()).astype(int) * 1000 + (index[1] - index[1].min()).astype(int)
    _, number = np.unique(label, return_inverse=True)
    number = number.reshape(label.shape)
    count, total = np.bincount(number.ravel()), np.bincount(number.ravel(), image.ravel())
    whole = count >= 0.9 * np.median(count)
    assert whole.sum() > 100, f"{whole.sum()} whole micro-images"
    bright = image / (total / count)[number]
    used = whole[number]
    at = np.clip(((inside[used] + 0.5) * BINS).astype(int), 0, BINS - 1)
    bin_of = at[:, 1] * BINS + at[:, 0]
    sums = np.bincount(bin_of, bright[used], BINS * BINS)
    return np.asarray((sums / np.bincount(bin_of, minlength=BINS * BINS)).reshape(BINS, BINS))


def predicted_micro_image(aperture: float) -> Array:
    """The micro-image on the axis for a numerical aperture: objective's pupil, tube lens, lenslets, by rays."""
    # The pupil of the objective: f = tube / magnification, so its diameter is 2·NA·f.
    pupil = 2 * aperture * TUBE / MAGNIFICATION
    shape = (BINS * 3, BINS * 3)
    camera = vcc.Camera(
        [
            vcc.Mask(vcc.patterns.Circle(pupil), z=0.0),
            vcc.Lens(focal_length=TUBE, z=TUBE),
            vcc.LensArray(pitch=PITCH, focal_length=FOCAL, z=2 * TUBE),
        ],
        vcc.Sensor(z=2 * TUBE + FOCAL, shape=shape, pitch=PITCH / BINS),
    )
    even = vcc.LightField.from_views(np.ones((5, 5, 8, 8), np.float32), pupil / 4, 4 * PITCH / TUBE / 4, np.inf)
    image = camera.capture(even, samples=4096).values.astype(np.float64)
    return over_pixels(image[BINS : 2 * BINS, BINS : 2 * BINS])


def over_pixels(image: Array) -> Array:
    """A periodic micro-image averaged over the sensor's pixels, as each is nearest to a bin."""
    wide = PIXEL / PITCH
    f = np.fft.fftfreq(BINS, 1 / BINS)
    blur = np.sinc(f * wide) * np.sinc(f / BINS)  # the pixel, and the bin that gathers pixels' middles
    return np.asarray(np.fft.ifft2(np.fft.fft2(image) * blur * blur[:, None]).real)


def by_waves(image: Array) -> Array:
    """The same with the diffraction of a square lenslet: sin²(πx·p/λf)/(…)², whose transform is a triangle."""
    f = np.fft.fftfreq(BINS, PITCH / BINS)
    triangle = np.maximum(1 - np.abs(f) * WAVELENGTH * FOCAL / PITCH, 0)
    return np.asarray(np.fft.ifft2(np.fft.fft2(image) * triangle * triangle[:, None]).real)


def top(image: Array) -> float:
    """The mean of the middle."""
    middle = slice(BINS // 2 - 2, BINS // 2 + 3)
    return float(image[middle, middle].mean())


def area_above_half(image: Array) -> float:
    """Bins above half the value in the middle."""
    return float((image > top(image) / 2).sum())


def corner(image: Array) -> float:
    """The mean of the four corners over that of the middle."""
    ends = np.concatenate([image[:2, :2], image[:2, -2:], image[-2:, :2], image[-2:, -2:]])
    return float(ends.mean()) / top(image)


# --- dual pixels ---

F_NUMBER, FOCAL_LENGTH, PIXEL_4, SAMPLE = 1.73, 4.38 * mm, 1.4 * um, 2.8 * um
ROWS, COLUMNS = 6, 8
"""Of the field, for each of which there is a kernel."""


def dual_pixel(folder: Path) -> tuple[Rows, Curves]:
    """The point spreads of both photodiodes of a Google Pixel 4, at one defocus, over the field."""
    pairs = [np.load(folder / f"blur_kernels_{side}.npy").astype(np.float64) for side in ("left", "right")]
    left, right = (
        np.array([aligned(a + b, (a, b)[side]) for a, b in zip(*pairs, strict=True)]) for side in range(2)
    )
    apart = np.array([separation(*pair) for pair in zip(left, right, strict=True)])
    central = [r * COLUMNS + c for r in (2, 3) for c in (3, 4)]
    size = float(np.mean([spread_of(left[n] + right[n]) for n in central]))

    def places(values: Array) -> str:
        """The mean of the four kernels in the middle, and of all others."""
        others = np.delete(values, central)
        return f"{values[central].mean():.2f} in the middle, {others.mean():.2f} ± {others.std():.2f} elsewhere"

    airy = 550e-9 * F_NUMBER
    fitted = fitted_crosstalk(float(apart[central].mean()))
    predictions = {
        "no crosstalk": 0.0,
        f"crosstalk λN of the microlens, {airy / um:.2f} µm": airy,
        f"crosstalk fitted in the middle, {fitted / um:.2f} µm": fitted,
    }
    x = np.asarray(np.arange(61) - 30.0, dtype=np.float64)
    mean = np.asarray(left[central].mean(axis=0).sum(axis=0), dtype=np.float64)
    curves = [("measured, middle", x, mean / float(mean.sum()))]
    rows: Rows = []
    for name, crosstalk in predictions.items():
        pair = predicted_pair(crosstalk, size)
        rows.append(
            (f"distance of the centroids over the spread, {name}", f"{separation(*pair):.2f}", places(apart))
        )
        both = zip(left, right, strict=True)
        alike = np.array([np.mean([correlation(*each) for each in zip(two, pair, strict=True)]) for two in both])
        rows.append((f"correlation of the kernels, {name}", places(alike), "1"))
        profile = np.asarray(pair[0].sum(axis=0), dtype=np.float64)
        curves.append((name, x, profile / float(profile.sum())))
    mirrored = np.array([correlation(a, b[:, ::-1]) for a, b in zip(left, right, strict=True)])
    rows.append(("correlation of left and mirrored right kernels", "1", places(mirrored)))
    across = right.reshape(ROWS, COLUMNS, *right.shape[1:])[:, ::-1, :, ::-1].reshape(right.shape)
    turned = np.array([correlation(a, b) for a, b in zip(left, across, strict=True)])
    rows.append(("the same at the mirrored place of the field", "1", places(turned)))
    rows.append(("left over right of a white sheet, over the field", "1", white_sheets(folder)))
    return rows, [("Left photodiode, summed along columns", "pixels of the recording", curves)]


def spread_of(kernel: Array) -> float:
    """Root mean square distance of a kernel from its centroid along x, pixels."""
    x = np.arange(kernel.shape[1])
    profile = kernel.sum(axis=0) / kernel.sum()
    middle = float(profile @ x)
    return float(np.sqrt(profile @ (x - middle) ** 2))


def separation(left: Array, right: Array) -> float:
    """The distance of two kernels' centroids along x over the spread of their sum."""
    x = np.arange(left.shape[1])
    there = [float(kernel.sum(axis=0) @ x / kernel.sum()) for kernel in (left, right)]
    return abs(there[1] - there[0]) / spread_of(left / left.sum() + right / right.sum())


def predicted_pair(crosstalk: float, spread: float) -> tuple[Array, Array]:
    """The point spreads of both photodiodes at the defocus whose sum has a spread; pixels of the recording."""
    diameter = 4 * spread * SAMPLE  # a disc's spread is a quarter of its diameter
    sensor = vcc.Sensor(
        z=FOCAL_LENGTH + diameter * F_NUMBER,
        shape=(61, 61),
        pitch=PIXEL_4,
        photodiodes=(1, 2),
        microlens=vcc.Microlens(f_number=F_NUMBER, crosstalk=crosstalk),
    )
    camera = vcc.Camera([vcc.Lens(focal_length=FOCAL_LENGTH, diameter=FOCAL_LENGTH / F_NUMBER)], sensor)
    found = [
        vcc.analysis.psf(camera.photodiode(0, n), np.inf, pitch=SAMPLE, shape=(61, 61), cells=256).values
        for n in range(2)
    ]
    # As the calibration states them: the point lies on the other side of the focus.
    return found[0].astype(np.float64), found[1].astype(np.float64)


def fitted_crosstalk(wanted: float) -> float:
    """The width of the ramp between photodiodes at which the centroids lie as far apart as measured."""
    widths = np.linspace(0, 3 * um, 13)
    apart = [separation(*predicted_pair(width, 5.5)) for width in widths]
    return float(np.interp(-wanted, -np.array(apart), widths))


def aligned(whole: Array, part: Array) -> Array:
    """A kernel shifted by whole pixels so that the centroid of both photodiodes' sum lies in the middle."""
    y, x = np.mgrid[: whole.shape[0], : whole.shape[1]]
    middle = [round(float((whole * each).sum() / whole.sum())) for each in (y, x)]
    return np.roll(part, (whole.shape[0] // 2 - middle[0], whole.shape[1] // 2 - middle[1]), axis=(0, 1))


def white_sheets(folder: Path) -> str:
    """The smallest, middle and largest ratio of the white recordings, in 6×8 places."""
    import imagecodecs

    left, right = (
        imagecodecs.imread(folder / f"white_sheet_{side}.png").astype(np.float64) - 1024
        for side in ("left", "right")
    )
    rows, columns = (
        np.array_split(np.arange(n), parts) for n, parts in zip(left.shape, (ROWS, COLUMNS), strict=True)
    )
    ratio = np.array([[left[np.ix_(r, c)].mean() / right[np.ix_(r, c)].mean() for c in columns] for r in rows])
    return f"{ratio.min():.2f} to {ratio.max():.2f}, median {np.median(ratio):.2f}"


# --- common ---


def correlation(one: Array, other: Array) -> float:
    """Pearson's."""
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


def draw(curves: Curves, path: Path) -> None:
    """Draw each panel."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        1, len(curves), figsize=(5.5 * len(curves), 3.6), squeeze=False, layout="constrained"
    )
    for axis, (title, label, lines) in zip(axes[0], curves, strict=True):
        for name, x, y in lines:
            dark = name.startswith("measured")
            axis.plot(x, y, "k-" if dark else "-", label=name, linewidth=2.2 if dark else 1.4)
        axis.set(title=title, xlabel=label, ylim=(0, None))
        axis.grid(alpha=0.25)
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=130)


CAMERAS = {"microscope": microscope, "dual-pixel": dual_pixel}

if __name__ == "__main__":
    main()
