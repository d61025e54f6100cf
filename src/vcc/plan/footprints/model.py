"""The plan: what is left of a camera once its optics are folded, as plain data for an engine.

The image is one sum over the samples of the light field,

    I(x, y) = scale · Σ_q L(q) · w(view) · Π T(m(q)) · F(x; x(q)) · F(y; y(q)),

in which every place is an affine function of the sample's index. The engine knows nothing of optics.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vcc.plan.depth_rule import ViewsBetween
from vcc.plan.footprints.shares import Division

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class MaskLookup:
    """A mask in mid-path, averaged over the cell of a sample: each sample looks its weight up here.

    Texture coordinates of sample (k, l) in view tap (b, a): (column, row) = (column[b, a], row[b, a])
    + step · (k, l). Weights are interpolated linearly between texture points and zero outside.

    Args:
        texture: mean transmission over a sample's footprint, at regular points, (rows, columns) float32.
        column: texture column of sample (0, 0) in each view tap, (rows of taps, columns of taps).
        row: texture row, likewise.
        step: 2×2, texture points per index step: [[column/k, column/l], [row/k, row/l]].
        label: which element this is.
    """

    texture: NDArray[np.float32]
    column: Array
    row: Array
    step: Array
    label: str

    def weights(self, b: int, a: int, k: Array, l: Array) -> Array:
        """T at the samples with column indices k and row indices l of view tap (b, a): shape (l, k)."""
        column = self.column[b, a] + self.step[0, 0] * k[None, :] + self.step[0, 1] * l[:, None]
        row = self.row[b, a] + self.step[1, 0] * k[None, :] + self.step[1, 1] * l[:, None]
        rows, columns = self.texture.shape
        dark_border = np.pad(self.texture.astype(np.float64), (1, 2))
        column, row = np.clip(column + 1, 0, columns + 1), np.clip(row + 1, 0, rows + 1)
        c, r = np.floor(column).astype(int), np.floor(row).astype(int)
        after_c, after_r = column - c, row - r
        above = dark_border[r, c] * (1 - after_c) + dark_border[r, c + 1] * after_c
        below = dark_border[r + 1, c] * (1 - after_c) + dark_border[r + 1, c + 1] * after_c
        return np.asarray(above * (1 - after_r) + below * after_r)


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """How to make the picture of a light field.

    A *view tap* (b, a) is a view, or where views are interpolated a place between views, that contributes
    to the picture: it reads view (view_rows[b], view_columns[a]). Places on the sensor are in pixels of the
    raster, which is the sensor with ``guard`` extra pixels on every side.

    Args:
        sensor_shape: (rows, columns) of the picture.
        guard: extra pixels around it, for light that the smear brings in from outside.
        interpolation: of footprints: ``"nearest"``, ``"linear"`` or ``"cubic"``.
        scale: turns stored samples times shares into irradiance.
        view_rows: row of views that each row of taps reads.
        view_columns: column of views that each column of taps reads.
        weights: (rows of taps, columns of taps), the share of each tap's cell that apertures let pass.
        x: raster column of sample (0, 0) in each tap, (rows of taps, columns of taps).
        y: raster row, likewise.
        step: 2×2, pixels per index step: [[x/k, x/l], [y/k, y/l]], |y/l| the larger of its row.
        masks: masks in mid-path.
        sensor_transmission: mean transmission of what lies against the sensor, (rows, columns), or None.
        sensor_detail: what its variation within pixels adds, from the light of each pixel's 3×3 neighbours, (3, 3,
            rows, columns): [dy, dx] is the share of the pixel dy − 1 rows down and dx − 1 columns on; or None.
        refine: how many finer samples replace one, along each pixel axis.
        smear: (vertical, horizontal) half width in pixels of the tent that fills the gap between the
            pictures of neighbouring views; 0 for none.
        opening: the share of a pixel's width, and of its height, that is sensitive ("nearest" ignores it).
        blur: kernel that the picture is convolved with, odd rows × odd columns of sum 1 (a diffuser), or None.
        view_blur: kernel that each view is convolved with before all else (a diffuser at the views), growing by
            half the kernel on each side, or None; ``samples`` and places count what is there after that.
        sharpen: weights (down, across), each an odd number of sum 1, by which the picture is filtered along its
            columns and rows to give back what interpolation took from sharpness (`vcc.plan.sharpening`), or None.
        sharpen_samples: an odd number of weights by which samples are filtered along both axes where they are
            divided (``refine``), or None.
        views_between: how views in between are made before all else, or None; taps count what is there after that.
        swap_pixel_axes: whether rows and columns of pixels change places before all else.
        samples: (rows, columns) of pixels of a view, after that change.
        missing_rays: share of the rays asked for that the light field lacks.
        missing_reason: in words.
        notes: what was decided and why, in words.
        expected_ghosting: largest gap in pixels between neighbouring views' pictures of the same thing
            that is left unfilled.
    """

    sensor_shape: tuple[int, int]
    guard: int
    interpolation: str
    scale: float
    view_rows: NDArray[np.int64]
    view_columns: NDArray[np.int64]
    weights: Array
    x: Array
    y: Array
    step: Array
    masks: tuple[MaskLookup, ...]
    sensor_transmission: Array | None
    refine: int
    smear: tuple[float, float]
    swap_pixel_axes: bool
    samples: tuple[int, int]
    missing_rays: float
    missing_reason: str
    notes: tuple[str, ...] = field(default=())
    expected_ghosting: float = 0.0
    opening: float = 1.0
    blur: Array | None = None
    view_blur: Array | None = None
    sharpen: tuple[Array, Array] | None = None
    sharpen_samples: Array | None = None
    sensor_detail: Array | None = None
    views_between: ViewsBetween | None = None

    def division(self, samples: int) -> Division:
        """How ``samples`` samples along an axis are divided into ``refine`` finer ones each."""
        return Division.of(self.interpolation, samples, self.refine, self.sharpen_samples)

    def columns(self, columns: NDArray[np.int64]) -> Plan:
        """The plan with some of its columns of view taps only: pictures of such pieces add up."""
        return replace(
            self,
            view_columns=self.view_columns[columns],
            weights=self.weights[:, columns],
            x=self.x[:, columns],
            y=self.y[:, columns],
            masks=tuple(replace(m, column=m.column[:, columns], row=m.row[:, columns]) for m in self.masks),
        )

    @property
    def raster_shape(self) -> tuple[int, int]:
        """(rows, columns) of the raster: the sensor and its guard."""
        return self.sensor_shape[0] + 2 * self.guard, self.sensor_shape[1] + 2 * self.guard

    @property
    def separable(self) -> bool:
        """Whether columns on the sensor follow from columns of the light field alone, and rows from rows.

        Masks are then looked up along rows and columns, too; where a tap meets them is its own affair.
        """
        steps = [self.step, *(mask.step for mask in self.masks)]
        return bool(
            np.ptp(self.x, axis=0).max() < 1e-6
            and np.ptp(self.y, axis=1).max() < 1e-6
            and all(
                max(abs(step[0, 1]) * self.samples[0], abs(step[1, 0]) * self.samples[1]) < 1e-6 for step in steps
            )
        )

    @property
    def row_step(self) -> float:
        """Raster rows from one row of samples to the next."""
        return float(self.step[1, 1])

    @property
    def column_step(self) -> float:
        """Raster columns from one column of samples to the next, along a fixed raster row."""
        (xk, _), (yk, _) = self.step
        return float(xk - self.shear * yk)

    @property
    def shear(self) -> float:
        """Raster columns by which a sample's place moves per raster row, its column index held."""
        (_, xl), (_, yl) = self.step
        return float(xl / yl)

    @property
    def direction(self) -> str:
        """From which side the shares are laid out: by sample ("forward") or by pixel ("backward")."""
        return "forward" if max(abs(self.row_step), abs(self.column_step)) <= 1 else "backward"

    @property
    def taps_used(self) -> int:
        """How many view taps let any light through."""
        return int(np.count_nonzero(self.weights))

    @property
    def samples_touched(self) -> int:
        """How many samples, refined ones counted, an engine goes through."""
        return self.taps_used * self.samples[0] * self.samples[1] * self.refine**2

    @property
    def cautions(self) -> tuple[str, ...]:
        """What a user should be warned of before a run: nothing, for footprints."""
        return ()

    @property
    def _blurs(self) -> list[tuple[str, tuple[int, ...], str]]:
        found = (("picture blurred", self.blur, "pixels"), ("views blurred", self.view_blur, "samples"))
        return [(name, kernel.shape, unit) for name, kernel, unit in found if kernel is not None]

    def __repr__(self) -> str:
        rows, columns = self.weights.shape
        lines = [
            f"Plan for a picture of {self.sensor_shape[0]}×{self.sensor_shape[1]} pixels "
            f"from {rows}×{columns} view taps ({self.taps_used} used) "
            f"of {self.samples[0]}×{self.samples[1]} samples",
            f"  step on the sensor: {self.row_step:.4g} rows, {self.column_step:.4g} columns a sample "
            f"({self.direction}, {self.interpolation}, {'separable' if self.separable else 'sheared'})",
            f"  masks in mid-path: {', '.join(mask.label for mask in self.masks) or 'none'}; "
            f"samples refined ×{self.refine}; smear {self.smear[0]:.3g}×{self.smear[1]:.3g} pixels",
            *(
                f"  {name} by a diffuser's kernel of {size[0]}×{size[1]} {unit}"
                for name, size, unit in self._blurs
            ),
            f"  missing rays: {self.missing_rays:.2%}",
        ]
        return "\n".join(lines + [f"  - {note}" for note in self.notes])
