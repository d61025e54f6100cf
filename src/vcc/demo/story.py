"""What the demo's page says: the paper's examples in words, with the numbers of the light field at hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from vcc.base.units import mm, short
from vcc.demo.report import Timing, duration, speed_up
from vcc.showcase.bench import Bench
from vcc.showcase.page import Panel, Section, psnr_table, timings_table
from vcc.showcase.scene import FAR, MIDDLE, NEAR

TITLE = "A virtual computational camera at work"

PLACES = {
    "leaves before the chart": (-0.128, -0.085, MIDDLE),
    "the chart's star": (-0.046, 0.030, MIDDLE),
    "lamps of the town": (0.48, -0.335, FAR),
}
"""Places of the built-in scene worth a close look: (X, Y, distance), metres."""
CHECK_PLACES = {
    "star": (-0.054, 0.026, MIDDLE),
    "letters": (0.068, 0.120, MIDDLE),
    "leaf": (-0.150, -0.020, NEAR),
}
MASK_TITLES = {"cosine": "cosine mask near the sensor", "coded": "coded mask half-way"}

_COMMENTS = {
    "nearest": "the paper’s: each pixel takes the nearest sample; rows and columns repeat or drop out: strips",
    "linear": "a sample fades over its neighbours; no strips, a little soft",
    "cubic": "Catmull-Rom; keeps more of the fine detail",
    "sharp": "the default: what linear interpolation and the views’ own pixels took is given back",
}


def length(metres: float) -> str:
    """A length as people read it, three digits."""
    return short(metres, digits=3).replace("um", "µm")


def away(distance: float) -> str:
    """A distance of the scene as people read it."""
    if math.isinf(distance):
        return "at infinity"
    return f"{distance:.3g} m away" if distance >= 0.1 else f"{length(distance)} away"


def places(bench: Bench) -> list[str]:
    """What the close-ups show."""
    if bench.scene is not None:
        return list(PLACES)
    return ["sharp when focused near", "sharp at middle distance", "sharp when focused far"]


def check_places(bench: Bench) -> list[str]:
    """What the check's close-ups show."""
    return list(CHECK_PLACES) if bench.scene is not None else ["near", "middle", "far"]


def truth_in_words(bench: Bench) -> str:
    """What the pinhole picture is compared with."""
    if bench.scene is not None:
        return "the scene’s closed form, traced through the pinhole at 4×4 points a pixel"
    return "a cubic spline through the view at the pinhole (no truth is known between its samples)"


def introduction(bench: Bench, timings: Sequence[Timing]) -> str:
    """The page's first paragraphs, HTML."""
    compared = [timing for timing in timings if timing.compared]
    speed = ""
    if compared:
        slowest = max(compared, key=lambda timing: timing.first)
        speed = (
            " One picture through a mask took the paper’s Matlab 8 minutes on a 3 GHz PC of 2009; here, "
            "with three "
            f"colours instead of one channel, it took {duration(slowest.first)}."
        )
    return (
        "<p>A camera takes a <i>light field</i>, bends, masks and sums it. Changyin Zhou’s <i>Virtual "
        "Computational "
        "Camera</i> (2009) simulates that: put lenses and masks along an axis, give the light field, get "
        "the picture "
        "that such a camera would record. Below are the paper’s two examples and its own check, computed a "
        "moment "
        f"ago on {_what(bench)}.{speed}</p>"
    )


def _what(bench: Bench) -> str:
    whose = "a built-in scene" if bench.scene is not None else "your light field"
    return f"{whose}, {_sizes(bench)}"


def _sizes(bench: Bench) -> str:
    nv, nu, nt, ns = bench.light_field.shape[:4]
    return f"{nv}×{nu} views of {nt}×{ns} pixels"


def _signed(number: float) -> str:
    return f"{number:.2g}".replace("-", "−")


@dataclass
class Told:
    """The sections of the page, as the demo goes along."""

    parts: list[Section] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)

    def missing(self, name: str, share: float) -> None:
        """Remember that a picture lacks some of its rays."""
        self.gaps.append(f"{name.replace('-', ' ')}: {share:.1%}")

    def light_field(self, bench: Bench) -> None:
        """The light field itself."""
        self.parts.append(
            Section(
                "The light field",
                _light_field_text(bench),
                [
                    [
                        Panel(
                            "light-field-views.png",
                            "Three of the views, and a slice through a row of them",
                            "Below, one row of pixels (dashed) of each view of the row, stacked. Each "
                            "thing leaves a "
                            "straight trace; the farther from the distance at which the views converge, "
                            "the more it "
                            "slopes, nearer things one way and farther ones the other.",
                        )
                    ]
                ],
            )
        )

    def example_one(self, bench: Bench, exposure: float) -> None:
        """The conventional camera."""
        self.parts.append(_example_one(bench, exposure))

    def example_two(self, bench: Bench) -> None:
        """The masks."""
        self.parts.append(_example_two(bench))

    def check(self, bench: Bench, psnr: dict[str, float]) -> None:
        """The pinhole pictures."""
        self.parts.append(_check(bench, psnr))

    def sections(self, timings: Sequence[Timing]) -> list[Section]:
        """All sections, the timings last."""
        gaps = ""
        if self.gaps:
            gaps = (
                "<p>Rays that a camera asked for and the light field does not hold (those parts are darker): "
                + "; ".join(self.gaps)
                + ".</p>"
            )
        note = (
            "<p>Wall-clock time on the machine that wrote this page. “First” is the first picture of its "
            "kind with "
            "everything compiled, “again” the same once more. The paper’s 8 minutes are for one picture "
            "through one mask from 500×500×20×20 samples of one channel, in Matlab, on an Intel PC of 2009 "
            "at 3 GHz: "
            "most of the difference is the method, some of it is the machine.</p>"
        )
        return [*self.parts, Section("What each step took", note, after=timings_table(timings) + gaps)]


def _light_field_text(bench: Bench) -> str:
    light_field = bench.light_field
    linear = light_field.frame.linear
    low, high = light_field.measured_disparity_range() or (0.0, 0.0)
    scaled = ""
    if bench.scene is None:
        scaled = (
            f" Its world was scaled by {bench.scale:.3g}, so that the grid of views is {length(20 * mm)} "
            "wide, as a "
            "lens is; all distances below are in that scaled world."
        )
        if bench.assumed:
            scaled += f" {bench.assumed}."
    convergence = float(linear[2, 0] / linear[0, 0])
    converging = f"F = {length(1 / convergence)}" if convergence else "F = ∞ (parallel views)"
    return (
        "<p>A light field tells the radiance of each ray, named by where it meets the plane of the lens, "
        "(u, v), and "
        f"by its slope, (s, t). It comes as {_sizes(bench)}: view i stands at u, and its pixel k looks "
        f"along s.{scaled}"
        "</p><p class=formula>u = (i − i₀)·Δu, &nbsp; s = u/F − (k − k₀)·p, &nbsp;&nbsp; likewise v, t"
        f"</p><p>Here Δu = {length(abs(linear[0, 0]))}, p = {abs(linear[2, 2]):.3g} a pixel, {converging}. "
        "A point at "
        f"distance Z moves by −Δu·(1/Z − 1/F)/p pixels from view to view: {_signed(low)} to {_signed(high)} "
        "in this scene.</p>"
    )


def _example_one(bench: Bench, exposure: float) -> Section:
    picture = {"near": bench.near, "middle": bench.middle, "far": bench.far}
    what = {"near": "", "middle": "", "far": ""}
    if bench.scene is not None:
        what = {
            "near": "The leaves are sharp. Lamps of the town blur into discs, each a picture of the round lens. ",
            "middle": "The chart is sharp to the pixel, leaves and town are not. ",
            "far": "The town is sharp; the leaves are spread so thin that one sees past them. ",
        }
    panels = [
        Panel(
            f"example-1-focused-{name}.png",
            f"Focused {name}, {away(distance)}",
            f"{what[name]}Sensor at d = {length(bench.image_distance(distance))}.",
        )
        for name, distance in picture.items()
    ]
    return Section(
        "Example 1: a conventional camera",
        "<p>A thin lens and empty space are linear: they move rays, and leave the radiance along each "
        "alone. So the "
        "samples need not be touched. Only the matrix that says <i>which ray each sample is</i> gets "
        "multiplied, once "
        "for each element; the sensor then sums all rays that land on a pixel:</p>"
        "<p class=formula>lens: s ← s − u/f &nbsp;&nbsp; flight: u ← u + d·s &nbsp;&nbsp; sensor: I(u, v) = "
        "∬ L(u, v, s, t) ds dt</p>"
        f"<p>With f = {length(bench.focal_length)} and a lens {length(bench.diameter)} wide, what is at "
        "distance Z is "
        "sharp at d where 1/d = 1/f − 1/Z; everything else blurs over A·|1 − d/d<sub>Z</sub>|, with A the "
        "lens’s "
        f"width. All three pictures are shown with one exposure (radiance 1 is white: × {exposure:.3g}).</p>",
        [
            panels,
            [
                Panel(
                    "example-1-close-ups.png",
                    "The same places in all three",
                    "Pixels as they are, not smoothed.",
                )
            ],
            [
                Panel(
                    "example-1-camera.png",
                    f"The camera, focused {away(bench.far)}",
                    "Rays from a point in focus, one beside it, and one so near that it blurs widely. "
                    "Heights are magnified.",
                )
            ],
            [
                Panel(
                    "example-1-phase-space-points.png",
                    "Two points of light in phase space (the paper’s Figure 4c)",
                    "Position u across, slope s up; the sensor at d = f. Parallel light, from a point "
                    "infinitely far "
                    "(blue), has one slope: a level line. Light from a point near (orange) leans the more "
                    "the nearer "
                    "it is. An element is a shear: the lens tilts (s changes), flight slides (u changes). "
                    "Focus is "
                    "where a line stands upright: all its light has one u, and the sensor, which sums each "
                    "upright "
                    "column, gets a point. The orange line still leans: it blurs.",
                )
            ],
            [
                Panel(
                    "example-1-phase-space-scene.png",
                    f"The same for a row of pixels of the light field, focused {away(bench.far)}",
                    "Many lines at once; on the sensor, those of what is in focus stand upright. Nothing "
                    "was resampled: each cell is a sample of the light field, "
                    "drawn where its frame puts it.",
                )
            ],
        ],
    )


def _example_two(bench: Bench) -> Section:
    cosine, coded = bench.cosine(), bench.coded()
    gap = cosine.sensor.z - cosine.elements[-1].z
    return Section(
        "Example 2: a mask between lens and sensor",
        "<p>A mask multiplies: L′(u, v, s, t) = L(u, v, s, t)·K(u, v), in its own plane. By then the rays "
        "have moved, "
        "and putting the field on a grid there would take far more samples than it has (the paper: 250⁴ "
        "and more). So "
        "the mask is pulled to the samples instead: linear optics says where on the mask each sample "
        "passes, and its "
        "weight is looked up there. Transform, mask and sum are one pass.</p>"
        "<p class=formula>I = S( 𝕋(L, "
        "M<sub>2</sub>(f)·M<sub>1</sub>(d<sub>1</sub>)·M<sub>1</sub>(d<sub>2</sub>)) · "
        "𝕋(K, M<sub>1</sub>(d<sub>2</sub>)) ) &nbsp;&nbsp; (paper, section 4.2)</p>"
        f"<p>Both cameras are focused on what is {away(bench.masked_focus)}. The exposure makes up for "
        "what a mask stops: four times that of Example 1 for the cosines, which let a quarter pass, "
        "twice for the coded mask, which is half open.</p>",
        [
            [
                Panel(
                    "example-2-cosine.png",
                    f"Cosine mask, {length(gap)} before the sensor",
                    "Veeraraghavan’s heterodyne camera (2007): in each period of the cosine the shadow "
                    "depends on the "
                    "direction that light came from. The picture carries directions as a modulation, from "
                    "which "
                    "a light field can be computed back.",
                ),
                Panel(
                    "example-2-coded.png",
                    f"Coded mask half-way, {length(coded.elements[-1].z)} behind the lens",
                    "Light of a sharp point crosses much of the mask and is only dimmed. A point out of "
                    "focus spreads "
                    "its light on the sensor, and the mask’s shadow shows in it: discs have become stamps "
                    "of the code.",
                ),
            ],
            [
                Panel(
                    "example-2-close-ups.png",
                    "Close-ups: no mask, cosine mask, coded mask",
                    "The same places, three cameras with the same focus.",
                )
            ],
            [Panel("example-2-masks.png", "The masks", "White lets all light pass, black none.")],
            [
                Panel(
                    "example-2-cosine-camera.png",
                    "The camera with the cosine mask",
                    "Rays end where a mask stops them.",
                ),
                Panel("example-2-coded-camera.png", "The camera with the coded mask", "Both drawn from the side."),
            ],
        ],
    )


def _check(bench: Bench, psnr: dict[str, float]) -> Section:
    if bench.scene is not None:
        against = (
            "The truth is the scene’s closed form, traced through the pinhole at 4×4 points of every "
            "pixel; it has "
            "never seen the light field."
        )
    else:
        against = (
            "Between a real view’s samples nobody knows the truth: the reference is a cubic spline through "
            "the view "
            "at the pinhole, averaged over each pixel. It is an interpolation too, so the decibels tell "
            "how well they agree, not how far either is from the world."
        )
    names = ("truth", "nearest", "linear", "cubic", "sharp")
    values = {"truth": "", **{name: f"{psnr[name]:.1f} dB" for name in psnr}}
    captions = {"truth": "What a pinhole there truly sees.", **_COMMENTS}
    panels = [
        Panel(
            f"check-{name}.png",
            f"{name.capitalize()} {values[name]}".strip(),
            captions[name][:1].upper() + captions[name][1:],
        )
        for name in names
    ]
    return Section(
        "The paper’s own check: a simulated pinhole picture",
        "<p>Closed down to a pinhole (a hole of "
        f"{length(bench.pinhole_diameter)} at one view, beside the axis), the camera must show what that "
        "view shows. "
        "The paper compares the two by eye, and finds strips, from taking the nearest sample. The sensor’s "
        "pixels are "
        f"not the views’ pixels here, so interpolation matters. {against} PSNR is in linear light, with "
        "radiance 1 as "
        "the peak, the outermost 3 % left out.</p>",
        [
            panels,
            [
                Panel(
                    "check-close-ups.png",
                    "Close-ups",
                    "Nearest breaks edges into steps; linear is soft; sharp is closest.",
                )
            ],
            [
                Panel(
                    "check-errors.png",
                    "What is wrong, three times magnified",
                    "Difference from the truth in linear light; mid-grey is none.",
                )
            ],
        ],
        after=psnr_table(psnr, _COMMENTS),
    )


@dataclass(frozen=True)
class Row:
    """A row of the contact sheet.

    Args:
        title: above it.
        text: below that.
        pictures: name and file of each.
    """

    title: str
    text: str
    pictures: Sequence[tuple[str, str]]


def sheet_rows(bench: Bench, psnr: dict[str, float], timings: Sequence[Timing]) -> list[Row]:
    """What the contact sheet shows, from top to bottom."""
    compared = [timing for timing in timings if timing.compared]
    speed = "".join(
        f"; {duration(timing.first)} ({speed_up(timing)} faster than the paper’s 8 min)" for timing in compared[:1]
    )
    return [
        Row(
            f"The light field: {_what(bench)}",
            "Three views of a row, and the slice through all views along the dashed line: slope tells distance.",
            [("", "light-field-views.png")],
        ),
        Row(
            "Example 1: a conventional camera; only the sensor moves",
            f"f = {length(bench.focal_length)}, lens {length(bench.diameter)} wide; one exposure.",
            [
                (f"focused near, {away(bench.near)}", "example-1-focused-near.png"),
                (f"focused in the middle, {away(bench.middle)}", "example-1-focused-middle.png"),
                (f"focused far, {away(bench.far)}", "example-1-focused-far.png"),
            ],
        ),
        Row(
            "The conventional camera in phase space (position u across, slope s up)",
            "A point is a line, sheared by lens and flight; sharp where it stands upright. Left: parallel light "
            "(blue) and a near point (orange), the paper’s Figure 4(c). Right: a row of pixels.",
            [
                ("", "example-1-phase-space-points.png"),
                ("", "example-1-phase-space-scene.png"),
            ],
        ),
        Row(
            f"Example 2: a mask between lens and sensor{speed}",
            "Cosine: the picture carries directions as a modulation. Coded: what is out of focus shows the mask.",
            [
                (MASK_TITLES["cosine"], "example-2-cosine.png"),
                (MASK_TITLES["coded"], "example-2-coded.png"),
                ("close-ups", "example-2-close-ups.png"),
            ],
        ),
        Row(
            "The cameras from the side",
            "Without a mask, and with the coded mask half-way; rays end where a mask stops them.",
            [
                ("", "example-1-camera.png"),
                ("", "example-2-coded-camera.png"),
            ],
        ),
        Row(
            "The paper’s own check: a simulated pinhole picture against the truth",
            f"Truth: {truth_in_words(bench)}. "
            + ", ".join(f"{name} {value:.1f} dB" for name, value in psnr.items()),
            [
                ("simulated pinhole picture, sharp", "check-sharp.png"),
                ("close-ups", "check-close-ups.png"),
            ],
        ),
    ]
