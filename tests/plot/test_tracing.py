"""Single rays, for drawing: they land where closed forms say, and those that split keep their light."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.optics import Scatter
from vcc.plot.tracing import BINS, branches, crossings, fan, openings, spread_along, trace
from vcc.shapes.surfaces import Axicon, Cubic

PLACES = np.linspace(-7, 7, 11) * mm
D = 40 * mm


def camera(*elements: vcc.Element, z: float = D) -> vcc.Camera:
    return vcc.Camera(elements, vcc.Sensor(z, (100, 100), 0.2 * mm))


def landed(drawn: vcc.Camera, x=PLACES, y=0.0, s=0.0, t=0.0):
    """Where rays end: (x, y), each of the rays' shape."""
    rays = np.stack(np.broadcast_arrays(x, y, s, t), axis=-1).astype(np.float64)
    paths = trace(drawn, rays)
    assert (paths.shares[:, -1] == 1).all()
    return paths.positions[:, -1].T


def test_a_cubic_plate_moves_rays_by_the_gradient_of_its_path():
    x, y = landed(camera(vcc.PhasePlate(Cubic(250.0), z=10 * mm)), y=2 * mm)
    # OPL = a(x³ + y³), a = 250/m²: Δs = 3ax².
    assert x == pytest.approx(PLACES + 30 * mm * 750 * PLACES**2, abs=1e-15)
    assert y == pytest.approx(2 * mm + 30 * mm * 750 * (2 * mm) ** 2, abs=1e-15)


def test_an_axicon_bends_all_rays_alike_along_their_radius():
    x, y = landed(camera(vcc.PhasePlate(Axicon(0.02))), x=np.array([3 * mm]), y=4 * mm)
    assert (x[0], y[0]) == pytest.approx((3 * mm - D * 0.02 * 0.6, 4 * mm - D * 0.02 * 0.8))


def test_a_biprism_bends_its_halves_towards_each_other():
    x = PLACES[PLACES != 0]
    assert landed(camera(vcc.Biprism(0.03)), x)[0] == pytest.approx(x - np.sign(x) * 0.03 * D, abs=1e-15)


def test_a_pyramid_bends_each_sector_along_its_own_direction():
    pyramid = vcc.Pyramid(sides=4, deflection=0.03, decentre=(1 * mm, -2 * mm))
    x = np.array([4, 1, -4, 1]) * mm
    y = np.array([-2, 3, -2, -5]) * mm
    found = np.array(landed(camera(pyramid), x, y))
    assert found == pytest.approx(
        np.array([x, y]) + D * 0.03 * np.array([[-1, 0, 1, 0], [0, -1, 0, 1]]), abs=1e-15
    )


def test_lenslets_at_their_focal_length_picture_the_main_lens():
    pitch, f = 0.5 * mm, 3 * mm
    array = vcc.LensArray(pitch=pitch, focal_length=f, z=D, width=21 * mm)
    plenoptic = camera(vcc.Lens(D), array, z=D + f)
    # Parallel light at slope −c/D comes to a point in the middle c of a lenslet, which bends nothing there: a ray
    # that crossed the main lens at u goes straight on, (c − u)·f/D aside.
    for cell in (0, 3):
        x, _ = landed(plenoptic, PLACES, s=cell * pitch / D)
        assert x == pytest.approx(cell * pitch + (cell * pitch - PLACES) * f / D, abs=1e-14)


def test_lenslets_elsewhere_relay_a_picture_each_for_itself():
    pitch, f, a = 0.5 * mm, 3 * mm, 12 * mm
    b = 1 / (1 / f - 1 / a)
    array = vcc.LensArray(pitch=pitch, focal_length=f, z=D + a, layout="hexagonal", offset=(0.1 * mm, 0.0))
    x, y = landed(camera(vcc.Lens(D), array, z=D + a + b), np.linspace(-7, 7, 201) * mm)
    at_array = -np.linspace(-7, 7, 201) * mm * a / D
    centre = 0.1 * mm + pitch * np.round((at_array - 0.1 * mm) / pitch)
    assert len(np.unique(centre.round(9))) > 5
    # The picture at (0, −a) lands magnified by −b/a about each lenslet's middle.
    assert x == pytest.approx(centre + centre * b / a, abs=1e-13)
    assert abs(y).max() == 0


def test_lenses_with_prisms_place_their_pictures_by_their_deflections():
    f, pitch, distance = 30 * mm, 5 * mm, 2.0
    b = 1 / (1 / f - 1 / distance)
    slopes = np.zeros((1, 3, 2))
    slopes[0, :, 0] = (-0.06, 0.01, 0.08)
    array = vcc.PrismArray(slopes, pitch=pitch, focal_length=f)
    x = np.linspace(-7, 7, 60) * mm
    cell = np.round(x / pitch).astype(int)
    expected = cell * pitch * (1 + b / distance) + b * slopes[0, cell + 1, 0]
    assert landed(camera(array, z=b), x, s=x / distance)[0] == pytest.approx(expected, abs=1e-14)


def test_a_thick_lens_bends_as_its_two_surfaces_do():
    r1, r2, n, thick = 40 * mm, -60 * mm, 1.5, 12 * mm
    lens = vcc.FirstOrder.thick_lens((r1, r2), thick, n, diameter=16 * mm, z=3 * mm)
    # By hand: n′s′ = ns − (n′ − n)u/R at each surface.
    inside = -(n - 1) * PLACES / r1 / n
    back = PLACES + thick * inside
    slope = n * inside - (1 - n) * back / r2
    x, _ = landed(camera(lens))
    assert x == pytest.approx(back + (D - 15 * mm) * slope, abs=1e-15)


def test_a_stop_inside_a_thick_element_is_met_at_the_true_height():
    before, behind = vcc.Affine.abcd(((0.8, 0.01), (-5.0, 1.1875))), vcc.Affine.propagation(0.02)
    whole = (behind @ before).linear[0:4:2, 0:4:2]
    system = vcc.FirstOrder(
        whole,
        30 * mm,
        stop_from_entrance=before.linear[0:4:2, 0:4:2],
        stop_diameter=8 * mm,
        exit_diameter=20 * mm,
        z=5 * mm,
        decentre=(1 * mm, 0.0),
    )
    paths = trace(camera(system), fan(np.array([1, 5, 7]) * mm, math.inf, 0.0, 0))
    # Entrance plane, the element's first plane, the stop, its last plane, the sensor. Places below about its axis.
    assert paths.z.tolist() == pytest.approx([0, 5 * mm, 15 * mm, 35 * mm, 40 * mm])
    u = np.array([0, 4, 6]) * mm
    assert paths.positions[:, 2, 0] - 1 * mm == pytest.approx(0.8 * u, abs=1e-15)
    assert paths.positions[:, 3, 0] - 1 * mm == pytest.approx((0.8 - 5 * 0.02) * u, abs=1e-15)
    assert paths.shares[:, 3].tolist() == [1, 1, 0]  # 0.8 · 6 mm is beyond the stop's 4 mm


def test_the_openings_of_a_camera():
    lens = vcc.Lens(50 * mm, diameter=20 * mm)
    mask = vcc.Mask(np.eye(4), width=6 * mm, z=10 * mm)
    found = list(openings(camera(lens, mask, vcc.Biprism(0.1, z=20 * mm)), axis=0))
    assert [(element, half) for element, _, half in found] == [(lens, 10 * mm), (mask, 3 * mm)]
    assert found[1][1].matrix[0, :3] == pytest.approx([1 - 10 / 50, 0, 10 * mm])


@dataclass(frozen=True)
class Swirl(vcc.Element):
    """Bends light around the axis, and takes half of it."""

    strength: float

    def faces(self) -> vcc.Faces:
        return vcc.Faces(
            deflection=lambda x, y: (-self.strength * y, self.strength * x),
            transmission=lambda x, y: 0.5 + 0 * x * y,
            scatter=vcc.kernels.Gaussian(0.01),
        )


def test_a_users_own_element():
    paths = trace(camera(Swirl(3.0)), [[2 * mm, 1 * mm, 0, 0.01]])
    assert paths.positions[0, -1] == pytest.approx((2 * mm - 3 * D * 1 * mm, 1 * mm + D * (0.01 + 3 * 2 * mm)))
    assert paths.shares[0].tolist() == [1, 1, 0.5]
    split = trace(camera(Swirl(3.0)), [[2 * mm, 1 * mm, 0, 0.01]], split_along=0)
    assert split.shares[:, -1].tolist() == pytest.approx([1 / 6] * 3)


def test_an_element_that_returns_nonsense_is_named():
    plate = vcc.PhasePlate(lambda x, y: (x / 0, y), name="broken")
    with np.errstate(all="ignore"), pytest.raises(vcc.InputError, match=r'phase plate "broken".*not finite'):
        trace(camera(plate), fan(PLACES, math.inf, 0.0, 0))


# --- rays that split ---

ONE_BIN = 2 * 4 / BINS
"""The width of a bin in σ, of a Gaussian cut at 4σ each way: a quantile is the mean of the bin that holds it."""


@pytest.mark.parametrize("axis", [0, 1])
def test_gaussian_rays_split_at_the_quantiles(axis):
    sigma = 0.02
    diffuser = vcc.Diffuser(vcc.kernels.Gaussian(sigma), z=10 * mm)
    paths = trace(camera(diffuser), fan(PLACES, math.inf, 0.0, axis), split_along=axis)
    assert len(paths.positions) == 3 * len(PLACES)
    turned = (paths.positions[:, -1, axis] - paths.positions[:, 1, axis]) / (30 * mm)
    expected = np.array([-1, 0, 1]) * NormalDist().inv_cdf(5 / 6)
    assert turned.reshape(-1, 3) / sigma == pytest.approx(np.tile(expected, (len(PLACES), 1)), abs=ONE_BIN)
    assert not paths.positions[:, :, 1 - axis].any()
    # Drawn once only before they part.
    assert (paths.starts.reshape(-1, 3) == [1, 0, 1]).all()


def test_split_rays_share_the_light_of_the_ray_that_they_were():
    fine, coarse = (vcc.Diffuser(vcc.kernels.TopHat(width), z=z) for width, z in ((0.01, 5 * mm), (0.05, 20 * mm)))
    dark = vcc.Mask(np.full((2, 2), 0.25), width=30 * mm, z=10 * mm)
    rays = fan(PLACES[:4], math.inf, 0.0, 0)
    drawn = camera(fine, dark, coarse)
    paths = trace(drawn, rays, split_along=0)
    assert paths.shares.shape == (4 * 9, 5)
    assert paths.shares[:, -1].reshape(4, 9).sum(axis=1) == pytest.approx([0.25] * 4)
    assert np.allclose(paths.shares[:, -1], 0.25 / 9)
    # Without an axis to split along, each ray goes on as one.
    assert len(trace(drawn, rays).shares) == 4


def test_two_spots_send_rays_to_the_spots():
    spots = np.zeros((1, 21))
    spots[0, [0, 20]] = 0.5
    kernel = vcc.kernels.Samples(spots, 0.002)
    turned = branches(Scatter((kernel,)), 0, np.zeros(1), np.zeros(1))[0]
    # Each sample fills a cell of 0.002.
    assert abs(abs(turned) - 0.02).max() < 0.001
    assert turned.min() < 0 < turned.max()
    assert spread_along(Scatter((kernel,)), 0, np.zeros(1), np.zeros(1)) == pytest.approx(0.02, rel=0.01)


def test_a_coded_diffuser_splits_rays_as_wide_as_it_is_there():
    widths = np.array([[0.0, 0.01, 0.03]])
    diffuser = vcc.CodedDiffuser(vcc.kernels.Gaussian(1.0), width=30 * mm, widths=widths)
    rays = fan(np.array([-12, 0, 12]) * mm, math.inf, 0.0, 0)
    paths = trace(camera(diffuser), rays, split_along=0)
    turned = (paths.positions[:, -1, 0] - paths.positions[:, 1, 0]).reshape(3, 3) / D
    expected = np.outer([0, 0.01, 0.03], [-1, 0, 1]) * NormalDist().inv_cdf(5 / 6)
    assert turned == pytest.approx(expected, abs=0.03 * ONE_BIN)


def test_many_diffusers_do_not_make_ever_more_rays():
    diffusers = [vcc.Diffuser(vcc.kernels.Gaussian(0.01), z=n * mm) for n in range(12)]
    paths = trace(camera(*diffusers), fan(PLACES, math.inf, 0.0, 0), split_along=0)
    assert len(paths.shares) <= 1500
    assert paths.shares[:, -1].sum() == pytest.approx(len(PLACES))


def test_planes_of_elements():
    assert [plane.z for plane in crossings(vcc.Lens(50 * mm, z=3 * mm))] == [3 * mm]
    thick = vcc.FirstOrder.thick_lens((40 * mm, -40 * mm), 6 * mm, 1.5, z=3 * mm)
    assert [plane.z for plane in crossings(thick)] == pytest.approx([3 * mm, 9 * mm])


def test_a_lenslet_whose_border_is_opaque_stops_rays():
    array = vcc.LensArray(pitch=1 * mm, focal_length=5 * mm, fill_factor=0.49)
    paths = trace(camera(array), fan(np.array([0.0, 340, 360, 640, 660]) * um, math.inf, 0.0, 0))
    # 0.7 of each cell is open, 350 µm from its middle.
    assert paths.shares[:, -1].tolist() == [1, 1, 0, 0, 1]
