"""Views of Gaussian splats against closed forms, a sum over all splats, ray casting and a lens's blur.

The oracles use float64 and the projection itself, differentiated numerically; nothing of the renderer's.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import erf, sph_harm_y

from tests.sources.splat_clouds import cloud, rotation_matrices, spheres
from vcc import InputError
from vcc.base.units import mm
from vcc.files.transfer import from_linear, to_linear
from vcc.sources import CameraArray, Viewpoint, synthesize
from vcc.sources.splats import Splats, SplatScene
from vcc.store import open_store

ARRAY = CameraArray((3, 3), (40, 60), (30 * mm, 40 * mm), (1 / 60, 1 / 50), 2.0)
TURNED = Viewpoint((0.3, -0.2, -0.4), (0.5, 0.1, 2.0), (0.2, -1.0, 0.1), unit=0.5)
NAMES = ("positions", "sizes", "rotations", "opacities", "harmonics")
LOW_PASSES = {"3dgs": (0.3, False), "mip": (0.1, True), "none": (0.0, False)}


def harmonic(index: int, direction: np.ndarray) -> np.ndarray:
    """Real spherical harmonic number l² + l + m by SciPy's complex ones, which have the Condon-Shortley phase."""
    l = math.isqrt(index)
    m = index - l * l - l
    x, y, z = direction
    value = sph_harm_y(l, abs(m), np.arccos(z), np.arctan2(y, x))
    if m == 0:
        return value.real
    # 3D Gaussian splatting keeps the phase: degree 1 is −y, z, −x
    return math.sqrt(2) * (value.real if m > 0 else value.imag)


def truth(splats: Splats, viewpoint: Viewpoint, camera, low_pass: str = "3dgs", background=0.0):
    """Image by the definition: every splat at every pixel, front to back; display-referred."""
    added, compensated = LOW_PASSES[low_pass]
    to_array = viewpoint.array_from_scene()
    rows, columns = camera.pixels

    def pixel(place):  # of a point in the scene: (column, row)
        x, y, z, _ = to_array @ [*place, 1]
        across = ((x - camera.x) / -z - camera.left) / (camera.right - camera.left)
        down = ((y - camera.y) / -z - camera.top) / (camera.bottom - camera.top)
        return np.array([across * columns - 0.5, down * rows - 0.5])

    eye = np.linalg.inv(to_array) @ [camera.x, camera.y, 0, 1]
    positions = splats.positions.astype(float)
    depth = -(positions @ to_array[2, :3] + to_array[2, 3])
    y, x = np.indices(camera.pixels)
    through, light = np.ones(camera.pixels), np.zeros((*camera.pixels, 3))
    turns = rotation_matrices(splats.rotations.astype(float))
    for n in np.argsort(depth):
        if depth[n] <= 0.2 * viewpoint.unit:
            continue
        step = 1e-5
        slopes = np.stack(
            [(pixel(positions[n] + d) - pixel(positions[n] - d)) / (2 * step) for d in np.eye(3) * step], axis=1
        )
        axes = slopes @ turns[n] @ np.diag(splats.sizes[n].astype(float))
        sharp = axes @ axes.T
        covariance = sharp + added * np.eye(2)
        off = np.stack([x, y], axis=-1) - pixel(positions[n])
        power = -0.5 * np.einsum("...i,ij,...j", off, np.linalg.inv(covariance), off)
        opacity = float(splats.opacities[n])
        if compensated:
            opacity *= math.sqrt(max(np.linalg.det(sharp), 0) / np.linalg.det(covariance))
        alpha = np.minimum(opacity * np.exp(power), 0.99)
        alpha[opacity * np.exp(power) < 1 / 255] = 0
        direction = positions[n] - eye[:3]
        direction /= np.linalg.norm(direction)
        colour = 0.5 + sum(
            harmonic(k, direction) * splats.harmonics[n, k] for k in range(splats.harmonics.shape[1])
        )
        light += (through * alpha)[..., None] * np.maximum(colour, 0)
        through *= 1 - alpha
    return light + through[..., None] * background


def inside(splats: Splats, viewpoint: Viewpoint, across: float, down: float) -> Splats:
    """The splats whose centres are within these tangents of the axis."""
    x, y, z = (viewpoint.array_from_scene() @ np.c_[splats.positions, np.ones(len(splats.positions))].T)[:3]
    good = (z < 0) & (abs(x / z) < across) & (abs(y / z) < down)
    return Splats(*(getattr(splats, name)[good] for name in NAMES))


@pytest.mark.parametrize("low_pass", LOW_PASSES)
@pytest.mark.parametrize("viewpoint", [Viewpoint(target=(0, 0, 1), up=(0, -1, 0)), TURNED])
def test_views_are_the_sum_over_all_splats(low_pass, viewpoint):
    # Beyond 15 % outside of a view, perspective is linearised elsewhere: centres are inside.
    splats = inside(cloud(150, degree=3, seed=4), viewpoint, 0.6, 0.35)
    scene = SplatScene(splats, viewpoint, low_pass=low_pass, transfer="linear", background=(0.3, 0.2, 0.1))
    for place in [(0, 0), (1, 2)]:
        camera = ARRAY.camera(*place)
        expected = truth(splats, viewpoint, camera, low_pass, np.array([0.3, 0.2, 0.1]))
        found = scene.render(camera)
        off = np.abs(found - expected)
        assert expected.std() > 0.1
        # Float32, and tiles end at a transmittance of 1e-4: 2e-4 of colours up to 2. At the outline of a splat,
        # 1/255 of its colour is drawn or not by rounding: few pixels.
        assert np.quantile(off, 0.99) < 2e-4
        assert off.max() < 2 / 255


@pytest.mark.parametrize("place", [(0, 0), (1, 1), (2, 0)])
def test_one_splat_in_closed_form(place):
    """A ball of standard deviation σ at depth Z is a Gaussian of σ·f/Z pixels where the frame has it."""
    x, y, depth, size = 0.07, -0.05, 1.6, 0.05
    one = Splats(
        *(np.array([each], np.float32) for each in ([x, y, depth], [size] * 3, [1, 0, 0, 0])),
        np.array([0.8], np.float32),
        np.full((1, 1, 3), 0.5 / 0.28209479177387814, np.float32),  # white
        transfer="linear",
    )
    row, column = place
    image = SplatScene(one, low_pass="none").render(ARRAY.camera(row, column))
    l, k = np.indices(ARRAY.pixels)
    u, v, s, t = np.moveaxis(ARRAY.frame(np.stack([0 * k + column, 0 * k + row, k, l], axis=-1)), -1, 0)
    px, py = u - depth * s, v - depth * t  # where the ray of a pixel meets the splat's plane
    # Perspective stretches the outline of a ball off the axis by 1 + tan²: tan is up to 0.04 here.
    a, b = (x - u) / depth, (y - v) / depth
    inverse = np.linalg.inv(np.moveaxis(np.array([[1 + a * a, a * b], [a * b, 1 + b * b]]), (0, 1), (2, 3)))
    off = np.stack([px - x, py - y], axis=-1)
    expected = 0.8 * np.exp(-0.5 * np.einsum("...i,...ij,...j", off, inverse, off) / size**2)
    drawn = expected > 1.02 / 255
    assert drawn.sum() > 60
    assert np.abs(image[..., 0] - expected)[drawn].max() < 1e-5


@pytest.mark.parametrize("first", [0, 1])
def test_the_nearer_of_two_hides_the_farther(first):
    """Two sheets: light is near·α₁ + far·(1 − α₁)·α₂, whatever their order in the file."""
    places, alphas = np.array([[0, 0, 1.0], [0, 0, 2.0]]), np.array([0.6, 0.9])
    order = [first, 1 - first]
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    two = Splats(
        places[order].astype(np.float32),
        np.array([[50, 50, 1e-3]] * 2, np.float32),
        np.array([[1, 0, 0, 0]] * 2, np.float32),
        alphas[order].astype(np.float32),
        ((colours[order, None] - 0.5) / 0.28209479177387814).astype(np.float32),
        transfer="linear",
    )
    scene = SplatScene(two, background=(0.0, 1.0, 0.0))
    image, depth, left = scene.render_with_depth(ARRAY.camera(1, 1))
    # the sheets are 50 m wide and seen over 1 m: flat to exp(−(1/50)²/2)
    assert image[20, 30] == pytest.approx([0.6, 0.4 * 0.1, 0.4 * 0.9], abs=1e-4)
    assert depth[20, 30] == pytest.approx(1.0, abs=1e-5)
    assert left[20, 30] == pytest.approx(0.04, abs=1e-5)


def test_splats_that_are_too_near_are_counted():
    splats = cloud(50)
    distances = np.sort(splats.positions[:, 2])
    scene = SplatScene(splats, near=float(distances[7:9].mean()))
    assert scene.left_out == 8
    assert np.array_equal(scene.render(ARRAY.camera(1, 1)), SplatScene(
        Splats(*(getattr(splats, name)[splats.positions[:, 2] > distances[7]] for name in NAMES))
    ).render(ARRAY.camera(1, 1)))  # fmt: skip


def test_colours_are_decoded_after_blending():
    splats = cloud(200, degree=1, seed=2)
    background = (0.2, 0.4, 0.05)
    shown = SplatScene(splats, background=background).render(ARRAY.camera(1, 1))
    coded = SplatScene(splats, transfer="linear", background=tuple(from_linear(background).tolist()))
    assert np.allclose(shown, to_linear(coded.render(ARRAY.camera(1, 1))), atol=1e-6)


def test_same_bytes_for_any_number_of_threads():
    splats = cloud(3000, degree=3, seed=1)
    array = CameraArray((1, 1), (130, 90), 1 * mm, 1 / 60)
    results = [SplatScene(splats, threads=n).render_with_depth(array.camera(0, 0)) for n in (1, 2, 5)]
    for other in results[1:]:
        for one, two in zip(results[0], other, strict=True):
            assert one.tobytes() == two.tobytes()


def test_spheres_hide_each_other_as_rays_meet_them():
    """Balls of opaque flat splats against ray casting: outlines, depth and occlusion in the outer views."""
    balls = [((-0.1, 0.0, 1.5), 0.25), ((0.25, 0.1, 2.0), 0.3), ((0.0, -0.3, 2.6), 0.35)]
    splats = spheres(balls, 20_000)
    array = CameraArray((3, 3), (120, 160), 60 * mm, 1 / 160, 2.0)
    scene = SplatScene(splats, low_pass="none", transfer="linear")
    for place in [(0, 0), (1, 1), (2, 1)]:
        camera = array.camera(*place)
        image, depth, _ = scene.render_with_depth(camera)
        across = camera.left + (np.arange(160) + 0.5) / 160 * (camera.right - camera.left)
        down = camera.top + (np.arange(120) + 0.5) / 120 * (camera.bottom - camera.top)
        ray = np.stack([*np.meshgrid(across, down), np.ones((120, 160))], axis=-1)
        nearest, which = np.full((120, 160), np.inf), np.full((120, 160), -1)
        for number, (middle, radius) in enumerate(balls):
            to = np.array(middle) - [camera.x, camera.y, 0]
            a, b, c = (ray * ray).sum(-1), ray @ to, to @ to - radius**2
            inside = b * b - a * c
            hit = np.where(inside > 0, (b - np.sqrt(np.maximum(inside, 0))) / a, np.inf)
            which = np.where(hit < nearest, number, which)
            nearest = np.minimum(nearest, hit)
        seen = np.where(np.isfinite(depth), np.argmax(image, axis=-1), -1)
        wrong = seen != which
        # Splats are flat, with σ of 4 mm: outlines are wrong by a pixel (7 to 16 mm) at most. They are 2π·0.3 m
        # long in all, about 170 pixels each.
        assert wrong.mean() < 0.02
        edge = np.zeros_like(wrong)
        for axis in (0, 1):
            for step in (-1, 1):
                edge |= np.roll(which, step, axis) != which
        assert not (wrong & ~edge).any()
        inner = (which >= 0) & ~wrong & ~edge
        off = np.abs(depth[inner] - nearest[inner])
        # depth of the surface: to a splat's own curvature, σ²/2R = 0.03 mm, times ten for oblique ones
        assert np.median(off) < 1e-3
        assert np.quantile(off, 0.95) < 1e-2


def test_depth_follows_a_tilted_plane():
    """Wide flat splats on a plane: the depth at each pixel is the plane's, not that of the centres."""
    rng = np.random.default_rng(3)
    tilt = math.radians(25)
    a, b = rng.uniform(-2.5, 2.5, 5000), rng.uniform(-1.5, 1.5, 5000)
    places = np.stack([a * math.cos(tilt), b, 2 + a * math.sin(tilt)], axis=1)
    splats = Splats(
        places.astype(np.float32),
        np.full((5000, 3), [0.08, 0.08, 1e-4], np.float32),
        np.full((5000, 4), [math.cos(tilt / 2), 0, -math.sin(tilt / 2), 0], np.float32),
        np.full(5000, 0.95, np.float32),
        np.zeros((5000, 1, 3), np.float32),
    )
    camera = ARRAY.camera(0, 2)
    _, depth, _ = SplatScene(splats, low_pass="none").render_with_depth(camera)
    across = camera.left + (np.arange(60) + 0.5) / 60 * (camera.right - camera.left)
    slope = math.tan(tilt)
    plane = (2 + slope * camera.x) / (1 - slope * across)
    # Depth is linear over a splat, of which at most 3σ = 0.24 m are drawn, 0.12 of the tangent: the next term of
    # Z = Z₀/(1 − tan 25° · tangent) is (0.47 · 0.12)² = 0.3 %. Of splats that overlap, those with
    # nearer centres absorb first, towards their rims: at 2σ it is 0.14 %.
    off = np.abs(depth / plane - 1)
    assert off.max() < 3e-3
    assert np.median(off) < 1.4e-3


@pytest.mark.parametrize("depth", [1.2, 4.0])
def test_the_mean_over_views_is_the_blur_of_a_lens(depth):
    """Views over a square aperture, one plane out of focus: the mean is the splat blurred by the circle's box.

    A splat's Gaussian of σ pixels, blurred by a box of c = A·f·|1/Z − 1/F| pixels, is a difference of erf.
    """
    views, size, aperture, focus = 17, 0.03, 0.12, 2.0
    array = CameraArray((views, views), (48, 64), aperture / views, 1 / 64, focus)
    one = Splats(
        np.array([[0.02, 0.03, depth]], np.float32),
        np.array([[size, size, 1e-6]], np.float32),
        np.array([[1, 0, 0, 0]], np.float32),
        np.array([0.9], np.float32),
        np.full((1, 1, 3), 0.5 / 0.28209479177387814, np.float32),
        transfer="linear",
    )
    mean = np.asarray(synthesize(SplatScene(one), array, dtype="float32").values).mean(axis=(0, 1))[..., 0]
    sigma = math.sqrt((size / depth * 64) ** 2 + 0.3)
    blur = aperture * 64 * abs(1 / depth - 1 / focus)
    assert blur > 1.5 * sigma

    def profile(count, centre):
        off = np.arange(count) - (count / 2 - 0.5) - centre * 64 / depth
        ends = [erf((off + sign * blur / 2) / (sigma * math.sqrt(2))) for sign in (1, -1)]
        return (ends[0] - ends[1]) / 2 * sigma * math.sqrt(2 * math.pi) / blur

    expected = 0.9 * np.outer(profile(48, 0.03), profile(64, 0.02))
    # 17 views for the integral: (step/σ)²/24 of the curvature, step = blur/17 < σ/5; and 1/255 cut at the outline.
    assert np.abs(mean - expected).max() < 0.9 / 255 + 0.002 * expected.max()
    assert mean.max() == pytest.approx(expected.max(), rel=0.02)


def test_stores_resume_and_hold_the_disparities(tmp_path):
    scene = SplatScene(spheres([((0, 0, 2.0), 0.4)], 3000), transfer="linear")
    array = CameraArray((2, 3), (24, 32), 20 * mm, 1 / 32, 1.8)

    class Stopping(SplatScene):
        def __init__(self, whole):
            self.__dict__.update(whole.__dict__)
            self.left = 2

        def render(self, camera):
            self.left -= 1
            if self.left < 0:
                raise InputError("stopped")
            return super().render(camera)

    path = tmp_path / "s.zarr"
    with pytest.raises(InputError, match="2 of 6 views are kept"):
        synthesize(Stopping(scene), array, path)
    stored = synthesize(scene, array, path)
    whole = synthesize(scene, array)
    assert np.array_equal(stored.read().values, whole.values)
    maps = open_store(path).disparity.maps()
    assert maps.views == ((0.0, 1.0),)
    assert np.array_equal(maps.values, whole.disparity.maps().values)
    assert maps.values[0, 12, 16] == pytest.approx(array.disparity(1.6), abs=0.02)
    assert maps.values[0, 0, 0] == pytest.approx(array.disparity(math.inf))
    with pytest.raises(InputError, match="another description"):
        synthesize(SplatScene(scene.splats, low_pass="none", transfer="linear"), array, path)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"low_pass": "gauss"}, "low_pass is one of"),
        ({"transfer": "gamma"}, "transfer is 'auto'"),
        ({"degree": 3}, "degree of the harmonics is a whole number from 0 to 1, not 3"),
        ({"near": 0}, "near is a distance in scene units"),
        ({"threads": 0}, "threads is a whole number, 1 or more"),
        ({"background": (0, -1, 0)}, "background is light"),
        ({"viewpoint": Viewpoint(target=(0, 0, -1))}, "all 5 splats are behind"),
    ],
)
def test_invalid_options(changed, message):
    with pytest.raises(InputError, match=message):
        SplatScene(cloud(5, degree=1), **changed)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("positions", np.nan, "1 of 5 splats have invalid positions .* the first is splat 2: .*nan"),
        ("sizes", np.inf, "invalid sizes"),
        ("sizes", -1, "invalid sizes"),
        ("opacities", 1.5, "invalid opacities"),
        ("harmonics", -np.inf, "invalid harmonics"),
        ("rotations", 7, "not a unit quaternion"),
    ],
)
def test_invalid_numbers(name, value, message):
    good = cloud(5, degree=1)
    arrays = {each: getattr(good, each).copy() for each in NAMES}
    arrays[name][2] = value
    with pytest.raises(InputError, match=message):
        Splats(**arrays)
