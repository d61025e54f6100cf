"""A map of rays through a lens as a polynomial with rotational symmetry, fitted to a table of rays.

With a the direction of a ray and b its place in the plane where the light is narrowest, both as vectors across the
axis and in units of their largest length, and u = a·a, v = a·b, w = b·b, symmetry about the axis and its planes
allows X = a·A(u, v, w) + b·B(u, v, w) and no other form, for the place X behind the lens and for the slope there.
A and B are polynomials of total degree n, X is one of degree 2n + 1 in the ray. Rays outside the fitted ones are
dark. Source: Goossens et al. 2022, Optics Express 30, 24031, whose polynomials do not have this form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief

Array = NDArray[np.float64]

HIGHEST = 6
"""Largest total degree n of the polynomials in u, v, w: of degree 13 in the ray."""
BANDS, TURNS = 41, 33
"""Rows and columns of the table of openings: by |a|, and by the angle between a and b."""
NEAR = 1 / 8
"""Differences of |a| up to which rays make the opening of a direction."""
GROWTH = 0.58
"""Exponent of the share that the hull of n rays lacks."""
LARGEST = 0.1
"""Largest share of the light by which the opening is made larger than the hull of the rays."""
FITTED, CHECKED = 2500, 2000
"""Most rays that a map is fitted to and checked on; they are drawn at random from the table."""


@dataclass(frozen=True, eq=False, repr=False)
class RayMap(Brief):
    """Rays of one plane mapped to another, within an opening; elsewhere no light passes.

    Args:
        order: n, the total degree of the polynomials.
        coefficients: (4, terms): A and B of the place, metres, and A and B of the slope. Terms are uⁱ·vʲ·wᵏ with
            i + j + k ≤ n, k fastest.
        distance: from the plane of the rays to that where b is taken, along +z, metres.
        steepest: slope that is the unit of a.
        widest: the unit of b, metres.
        centre: (4,): of the opening, a·(c₀ + c₁u + c₂u² + c₃u³), in units of b.
        opening: `BANDS` × `TURNS`: the largest |b − centre| at |a| from 0 to 1, and at (1 − cosφ)/2 from 0 to 1,
            with φ the angle between a and b − centre. Between them it is interpolated.
    """

    order: int
    coefficients: Array
    distance: float
    steepest: float
    widest: float
    centre: Array
    opening: Array

    ratio = 1.0
    """A map begins and ends in air."""

    @property
    def radius(self) -> float:
        """Of a disc, at ``distance``, that all its light passes, metres."""
        away = np.linspace(0, 1, BANDS)
        shift = np.abs(away * np.polynomial.polynomial.polyval(away**2, self.centre))
        return self.widest * float((shift + self.opening.max(axis=1)).max())

    def sag(self, square: Array) -> tuple[Array, Array]:
        """The disc is flat: zeros for sag and slope, as of a surface."""
        return 0 * square, 0 * square

    def without_rim(self) -> RayMap:
        """The map itself: it is not known outside its opening."""
        return self

    def variables(self, x: Array, y: Array, s: Array, t: Array) -> tuple[Array, Array]:
        """a and b, (..., 2) each."""
        a = np.stack([s, t], axis=-1) / self.steepest
        return a, np.stack([x + self.distance * s, y + self.distance * t], axis=-1) / self.widest

    def aside(self, a: Array, b: Array) -> Array:
        """b from the centre of the opening, (..., 2)."""
        shift = np.polynomial.polynomial.polyval((a * a).sum(axis=-1), self.centre)
        return np.asarray(b - a * shift[..., None])

    def passes(self, a: Array, b: Array) -> NDArray[np.bool_]:
        """Whether rays are within the opening."""
        away, aside = np.sqrt((a * a).sum(axis=-1)), self.aside(a, b)
        far = np.sqrt((aside * aside).sum(axis=-1))
        with np.errstate(invalid="ignore", divide="ignore"):
            cosine = np.nan_to_num((a * aside).sum(axis=-1) / (away * far))
        row = np.where(away <= 1, away, 0.0) * (BANDS - 1)
        column = (1 - np.clip(cosine, -1, 1)) / 2 * (TURNS - 1)
        i, j = (np.minimum(at.astype(np.int64), most - 2) for at, most in ((row, BANDS), (column, TURNS)))
        p, q = row - i, column - j
        edge = self.opening
        low = edge[i, j] + q * (edge[i, j + 1] - edge[i, j])
        high = edge[i + 1, j] + q * (edge[i + 1, j + 1] - edge[i + 1, j])
        return np.asarray((away <= 1) & (far <= low + p * (high - low)))

    def refracted(self, x: Array, y: Array, s: Array, t: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Rays in the other plane, and the share of light that passes: 1, or 0 outside the opening, on the axis.

        Args:
            x: places of rays, metres.
            y: likewise.
            s: slopes.
            t: likewise.
        """
        a, b = self.variables(x, y, s, t)
        lit = self.passes(a, b)
        a, b = np.where(lit[..., None], a, 0.0), np.where(lit[..., None], b, 0.0)
        of = np.einsum("...t,ft->f...", terms(a, b, self.order), self.coefficients)[..., None]
        place, slope = (np.moveaxis(a * of[n] + b * of[n + 1], -1, 0) for n in (0, 2))
        return place[0], place[1], slope[0], slope[1], lit.astype(np.float64)

    def pulled(self, rays: tuple[Array, ...], behind: tuple[Array, ...]) -> tuple[Array, Array, Array, Array]:
        """Cotangents of the rays (x, y, s, t) before the map from those behind it."""
        a, b = self.variables(*rays)
        lit = self.passes(a, b)[..., None]
        a, b = np.where(lit, a, 0.0), np.where(lit, b, 0.0)
        values, *slopes = (
            np.einsum("...t,ft->f...", each, self.coefficients)[..., None]
            for each in (terms(a, b, self.order), *slopes_of_terms(a, b, self.order))
        )
        g_a, g_b = np.zeros_like(a), np.zeros_like(b)
        for n, pair in ((0, behind[:2]), (2, behind[2:])):
            g = np.where(lit, np.stack(pair, axis=-1), 0.0)
            along_a, along_b = ((g * each).sum(axis=-1, keepdims=True) for each in (a, b))
            by_u, by_v, by_w = (along_a * each[n] + along_b * each[n + 1] for each in slopes)
            g_a = g_a + values[n] * g + 2 * by_u * a + by_v * b
            g_b = g_b + values[n + 1] * g + by_v * a + 2 * by_w * b
        g_b = g_b / self.widest
        slope = g_a / self.steepest + self.distance * g_b
        return g_b[..., 0], g_b[..., 1], slope[..., 0], slope[..., 1]

    @property
    def matrix(self) -> Array:
        """((A, B), (C, D)) of rays next to the axis, (2, 2), SI."""
        (of_a, of_b) = self.coefficients[0::2, 0] / self.steepest, self.coefficients[1::2, 0] / self.widest
        return np.stack([of_b, of_a + self.distance * of_b], axis=1)


def exponents(order: int) -> Array:
    """(i, j, k) of each term, in the order of `RayMap.coefficients`: (terms, 3)."""
    return np.array(
        [(i, j, k) for i in range(order + 1) for j in range(order + 1 - i) for k in range(order + 1 - i - j)]
    )


def terms(a: Array, b: Array, order: int) -> Array:
    """uⁱ·vʲ·wᵏ of each term, (..., terms)."""
    powers = _powers(a, b, order)
    i, j, k = exponents(order).T
    return np.asarray(powers[0][..., i] * powers[1][..., j] * powers[2][..., k])


def slopes_of_terms(a: Array, b: Array, order: int) -> tuple[Array, Array, Array]:
    """Derivatives of the terms to u, v and w, (..., terms) each."""
    powers, found = _powers(a, b, order), []
    listed = exponents(order).T
    for n in range(3):
        lowered = [np.maximum(each - (m == n), 0) for m, each in enumerate(listed)]
        product = [powers[m][..., each] for m, each in enumerate(lowered)]
        found.append(listed[n] * product[0] * product[1] * product[2])
    return found[0], found[1], found[2]


def _powers(a: Array, b: Array, order: int) -> list[Array]:
    return [
        (one * other).sum(axis=-1)[..., None] ** np.arange(order + 1) for one, other in ((a, a), (a, b), (b, b))
    ]


# --- from a table ---


@dataclass(frozen=True)
class Fit(Brief):
    """A map, and how well it is known.

    Args:
        map: of rays.
        place: root mean square error of places, metres, over rays that were not fitted.
        slope: likewise of slopes.
        edge: share of light that the edge of the opening may be wrong by: estimated from the table's density.
        empty: share of the opening that is far from all rays of the table, where it is not convex.
    """

    map: RayMap
    place: float
    slope: float
    edge: float
    empty: float


def fits(rays: Array, behind: Array, highest: int = HIGHEST) -> list[Fit]:
    """Maps from the rays of one plane to those of another, of rising degree.

    Args:
        rays: (n, 4): x, y, metres, and slopes s, t of rays that pass.
        behind: (n, 4), of the same rays in the other plane.
        highest: largest total degree in u, v, w; fewer rays than four for each coefficient allow less.
    """
    from scipy.linalg import solve_triangular  # slow to import

    places, slopes = rays[:, :2], rays[:, 2:]
    distance = -float((places * slopes).sum() / (slopes * slopes).sum())
    narrow = places + distance * slopes
    steepest, widest = (float(np.linalg.norm(each, axis=1).max()) for each in (slopes, narrow))
    a, b = slopes / steepest, narrow / widest
    centre, opening, edge, empty = _opening(a, b)
    order = np.random.default_rng(0).permutation(len(rays))
    held = min(len(rays) // 3, CHECKED)
    checked, fitted = order[:held], order[held:][:FITTED]
    while highest > 0 and 2 * len(fitted) < 8 * len(exponents(highest)):
        highest -= 1
    # Terms by rising degree: the maps of all degrees then share one triangular matrix.
    degrees = exponents(highest).sum(axis=1)
    rising = np.argsort(degrees, kind="stable")
    some, others = (terms(a[rows], b[rows], highest)[:, None, rising] for rows in (fitted, checked))
    columns = np.stack([some * a[fitted, :, None], some * b[fitted, :, None]], axis=-1)
    wanted = np.stack([behind[fitted, :2].ravel(), behind[fitted, 2:].ravel()], axis=1)
    q, r = np.linalg.qr(columns.reshape(2 * len(fitted), -1))
    wanted = q.T @ wanted
    tried = np.stack([others * a[checked, :, None], others * b[checked, :, None]], axis=-1)
    tried = tried.reshape(2 * held, -1)
    found = []
    for degree in range(highest + 1):
        count = int((degrees <= degree).sum())
        solved = solve_triangular(r[: 2 * count, : 2 * count], wanted[: 2 * count])
        coefficients = np.empty((4, count))
        # Lower degrees keep the order of the terms among themselves.
        coefficients[:, np.argsort(np.argsort(rising[:count]))] = solved.reshape(count, 2, 2).T.reshape(4, count)
        off = tried[:, : 2 * count] @ solved - np.stack(
            [behind[checked, :2].ravel(), behind[checked, 2:].ravel()], 1
        )
        place, slope = np.sqrt(2 * (off**2).mean(axis=0)).tolist()
        one = RayMap(degree, coefficients, distance, steepest, widest, centre, opening)
        found.append(Fit(one, place, slope, edge, empty))
    return found


def _opening(a: Array, b: Array) -> tuple[Array, Array, float, float]:
    """The part of (|a|, b − centre) that rays fill: for each |a|, a section of the convex hull of rays near it.

    Rims are discs, so the light of one direction is convex. The hull of n random rays is smaller than the light by
    a share of n^(−1/2) to n^(−2/3) (Bárány 2008, *Bull. AMS* 45, 339), which its growth from half of the rays to
    all of them shows; openings are larger by this share.
    """
    from scipy.spatial import cKDTree  # slow to import

    away = np.sqrt((a * a).sum(axis=1))
    along = np.stack([a, np.stack([-a[:, 1], a[:, 0]], axis=1)], axis=1) / np.maximum(away, 1e-12)[:, None, None]
    inside = np.einsum("nij,nj->ni", along, b)
    powers = (away**2)[:, None] ** np.arange(4) * away[:, None]
    centre = np.linalg.lstsq(powers, inside[:, 0], rcond=None)[0]
    inside[:, 0] -= powers @ centre
    points = np.column_stack([away, inside])
    # The planes of symmetry: y to −y across a, and a and b both reversed.
    sides = [np.array([flip, flip, side]) for side in (1, -1) for flip in (1, -1)]
    mirrored = np.concatenate([points * each for each in sides])
    half = np.tile(np.random.default_rng(1).permutation(len(points)) % 2 == 0, 4)
    rows = np.linspace(0, 1, BANDS)
    opening, growth = np.zeros((BANDS, TURNS)), np.zeros(BANDS)
    for row, at in enumerate(np.minimum(rows, 1 - 0.25 / BANDS)):
        near = np.abs(mirrored[:, 0] - at) < NEAR
        opening[row] = _section(mirrored[near], at)
        fewer = _section(mirrored[near & half], at)
        growth[row] = (opening[row] ** 2).sum() / max((fewer**2).sum(), 1e-12) - 1
    growth = np.convolve(np.pad(growth, 2, "edge"), np.full(5, 0.2), "valid")
    missing = np.clip(growth / (2**GROWTH - 1), 0, 1)
    opening *= 1 + np.minimum(missing, LARGEST)[:, None] / 2
    # Places of the opening that are far from every ray: the light is not convex there.
    tree, rng = cKDTree(mirrored), np.random.default_rng(2)
    apart = tree.query(points[rng.permutation(len(points))[:2000]], k=2)[0][:, 1]
    at, angle, share = rng.uniform(0, 1, (3, 4000)) * [[BANDS - 1], [np.pi], [1]]
    reach = opening[at.astype(int), ((1 - np.cos(angle)) / 2 * (TURNS - 1)).astype(int)]
    far = reach * np.sqrt(share) * 0.97
    drawn = np.column_stack([at.astype(int) / (BANDS - 1), far * np.cos(angle), far * np.sin(angle)])
    lost = tree.query(drawn)[0] > 3 * np.quantile(apart, 0.99)
    weights = np.maximum(reach, 1e-12) ** 2 * at
    light = (opening**2).sum(axis=1) * rows
    return centre, opening, float(np.average(missing, weights=light)), float(np.average(lost, weights=weights))


def _section(points: Array, at: float) -> Array:
    """The section of the convex hull of points (n, 3) at one of their first coordinate, by angle: (TURNS,)."""
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        faces = ConvexHull(points).equations
    except (QhullError, ValueError):  # fewer than four points, or all in one plane
        return np.zeros(TURNS)
    cosine = 1 - 2 * np.linspace(0, 1, TURNS)
    turned = faces[:, 1:3] @ np.stack([cosine, np.sqrt(1 - cosine**2)])
    room = np.maximum(-(faces[:, 3] + faces[:, 0] * at), 0.0)[:, None]
    return np.asarray(np.where(turned > 1e-12, room / np.where(turned > 1e-12, turned, 1.0), np.inf).min(axis=0))
