"""Camera files: what is read, that writing loses nothing, what is said of a wrong file."""

import math
import re
from dataclasses import dataclass, field

import imagecodecs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from vcc import (
    Affine,
    AngleFilter,
    Biprism,
    Camera,
    CodedDiffuser,
    DiffractiveLens,
    Diffuser,
    Electronics,
    Element,
    Faces,
    FirstOrder,
    InputError,
    Lens,
    LensArray,
    Louvre,
    Mask,
    Microlens,
    PhasePlate,
    Prism,
    PrismArray,
    Pyramid,
    RayTable,
    RayTableLens,
    RealLens,
    ResultWarning,
    Sensor,
    Spectrum,
    load_camera,
    load_lens,
)
from vcc.base.units import deg, mm, nm, um
from vcc.camera_file import ELEMENT_KINDS, GLASS_NAMES, KERNEL_NAMES, PATTERN_NAMES, SURFACE_NAMES, save_camera
from vcc.files.camera_reading import read_train
from vcc.files.camera_writing import write_train
from vcc.files.image_metadata import CameraMark
from vcc.optics import glass as glasses
from vcc.optics.prescription import Prescription
from vcc.optics.prescription import Surface as LensSurface
from vcc.optics.train import Train
from vcc.shapes import by_channel, kernels, patterns, surfaces
from vcc.shapes.directional import AngularFringes, Gaps, SoftRectangle
from vcc.shapes.lattice import CellApertures, CellBlock, Lattice
from vcc.shapes.stacked_patterns import Product

SENSOR = '\n[sensor]\nz = "52 mm"\nshape = [500, 400]\npitch = "48 um"\n'
LENS = '[[elements]]\nkind = "lens"\nz = "0 mm"\nfocal_length = "50 mm"\n'


def element(kind="lens", **fields):
    lines = [f"kind = {kind!r}"] if kind else []
    lines += [f"{name} = {value}" for name, value in fields.items()]
    return "[[elements]]\n" + "\n".join(lines) + "\n"


def one(kind, **fields):
    """A file with one element and a sensor."""
    return element(kind, **fields) + SENSOR


@pytest.fixture
def written(tmp_path):
    """Writes a camera file and reads it."""

    def write_and_load(text):
        (tmp_path / "camera.toml").write_text(text, encoding="utf-8")
        return load_camera(tmp_path / "camera.toml")

    return write_and_load


def test_reads_the_documented_form(tmp_path, written):
    cells = np.array([[0, 255], [128, 255], [255, 0]], np.uint8)
    (tmp_path / "mask.png").write_bytes(imagecodecs.png_encode(cells))
    camera = written(
        """
        [[elements]]
        kind = "lens"
        name = "front"
        z = "0 mm"
        focal_length = "50 mm"
        diameter = "20 mm"
        [[elements]]
        kind = "mask"
        z = "40 mm"
        pattern = "mask.png"
        width = "30 mm"
        [[elements]]
        kind = "prism"
        z = "41 mm"
        deflection = [0.01, 0]
        decentre = ["1 mm", "-2 mm"]
        """
        + SENSOR
    )
    assert camera.elements[0] == Lens(50 * mm, 20 * mm, name="front")
    assert camera.elements[1] == Mask(cells / 255, 30 * mm, z=40 * mm)
    assert camera.elements[1].source == "mask.png"
    assert camera.elements[2] == Prism((0.01, 0), z=41 * mm, decentre=(1 * mm, -2 * mm))
    assert camera.sensor == Sensor(z=52 * mm, shape=(500, 400), pitch=48 * um)


def test_an_optical_train_is_what_is_read_and_written(tmp_path, written):
    camera = written(LENS + SENSOR)
    train = read_train(tmp_path / "camera.toml")
    assert type(train) is Train
    assert (train.elements, train.sensor) == (camera.elements, camera.sensor)
    write_train(train, tmp_path / "again.toml")
    assert read_train(tmp_path / "again.toml") == train
    assert load_camera(tmp_path / "again.toml") == camera


@pytest.mark.parametrize(
    ("toml", "pattern"),
    [
        ('{ name = "circle", diameter = "5 mm" }', patterns.Circle(5 * mm)),
        ('{ name = "Circle", diameter = "5 mm" }', patterns.Circle(5 * mm)),
        (
            '{ name = "polygon", sides = 6, diameter = "5 mm", rotation = "30 deg" }',
            patterns.Polygon(6, 5 * mm, 30 * deg),
        ),
        (
            '{ name = "cosine_sum", period = ["1 mm", "inf m"], harmonics = 3 }',
            patterns.CosineSum((1 * mm, math.inf), 3),
        ),
        (
            '{ name = "cells", values = [[0, 1], [0.5, 0]], width = "4 mm", middle = ["1 mm", "0 mm"] }',
            patterns.Cells(np.array([[0, 1], [0.5, 0]]), 4 * mm, middle=(1 * mm, 0.0)),
        ),
        (
            '{ name = "bounded", width = "1 mm", height = "2 mm", pattern = { name = "open" } }',
            patterns.Bounded(patterns.Open(), 1 * mm, 2 * mm),
        ),
        ('{ name = "mura", prime = 7 }', patterns.Cells(patterns.mura(7), 10 * mm)),
        ("[[0, 1], [0.25, 1]]", patterns.Cells(np.array([[0, 1], [0.25, 1]]), 10 * mm)),
    ],
)
def test_reads_patterns_by_name(written, toml, pattern):
    camera = written(f'[[elements]]\nkind = "mask"\nwidth = "10 mm"\npattern = {toml}\n{SENSOR}')
    assert camera.elements[0].pattern == pattern


def test_reads_cells_from_npy_and_csv(tmp_path, written):
    cells = np.array([[0, 1 / 3], [0.1, 1]])
    np.save(tmp_path / "a.npy", cells)
    np.savetxt(tmp_path / "a.csv", cells, delimiter=",", fmt="%.17g")
    np.save(tmp_path / "bytes.npy", np.array([[0, 255]], np.uint8))
    for file, expected in (("a.npy", cells), ("a.csv", cells), ("bytes.npy", [[0, 1]])):
        camera = written(f'[[elements]]\nkind = "mask"\nwidth = "1 mm"\npattern = "{file}"\n{SENSOR}')
        assert np.array_equal(camera.elements[0].pattern.values, expected)


RANDOM = np.random.default_rng(1)
WEIGHTS = RANDOM.random((2, 3, 4))
HEXAGONS = Lattice("hexagonal", 1 / 3 * mm, 0.1, (1e-4, 0))
COLOUR = Electronics(
    quantum_efficiency=(0.5, 1 / 3, 0.4),
    wavelength=(620 * nm, 530 * nm, 460 * nm),
    color_filter="GRBG",
    bit_depth=10,
)
FILTER = Spectrum((400 * nm, 0.7 * um), (0.1 / 3, 1.0))
EVERYTHING = Camera(
    [
        Lens(50 * mm, 20 * mm, name="front"),
        Lens(-7.3e-2, z=1 / 3 * mm, decentre=(1e-3 / 7, 0)),
        Prism((0.1 / 3, -0.02), z=2 * mm),
        Mask(np.random.default_rng(1).random((3, 5)), 10 * mm, z=3 * mm, name="coded, 1"),
        Mask(np.random.default_rng(2).random((3, 5)), 10 * mm, 4 * mm, z=3 * mm, name="coded 1"),
        Mask(patterns.mura(7), 10 * mm, z=4 * mm),
        Mask(patterns.CosineSum((1 * mm, math.inf), 3, phase=0.1), z=5 * mm),
        Mask(patterns.Polygon(6, 8 * mm, rotation=0.2), 9 * mm, z=6 * mm),
        Mask(patterns.Cells(np.eye(2) / 3, 1 * mm, middle=(2e-3, 1e-3)), z=7 * mm),
        Mask(patterns.Cells(np.eye(2) / 3, 1 * mm), 2 * mm, z=8 * mm),
        Mask(patterns.Bounded(patterns.Circle(3 * mm), 1 * mm, 2 * mm), z=9 * mm),
        Mask(patterns.Open(), z=9 * mm),
        Mask(patterns.Circle(4 * mm), z=9 * mm),
        Mask(Product((CellApertures(HEXAGONS, 0.7, circular=True), CellBlock(HEXAGONS, 3, 4))), z=10 * mm),
        Diffuser(kernels.Gaussian(0.1 / 3), diameter=9 * mm, z=11 * mm),
        Diffuser(kernels.Gaussian((0.01, 1e-9)), width=9 * mm, height=3 * mm, z=12 * mm),
        Diffuser(kernels.TopHat(0.02, "square"), z=12 * mm),
        Diffuser(kernels.Radial((0, 0.01, 0.03), (1, 0.5, 0), normalise=True), z=13 * mm),
        Diffuser(RANDOM.random((3, 4)), 1e-3, normalise=True, z=13 * mm, name="measured"),
        CodedDiffuser(
            (kernels.Gaussian(0.01), kernels.TopHat(0.1 / 3)),
            5 * mm,
            WEIGHTS,
            normalise=True,
            z=14 * mm,
            name="mixed",
        ),
        CodedDiffuser(kernels.Gaussian(1.0), 5 * mm, widths=RANDOM.random((2, 3)), height=4 * mm, z=14 * mm),
        PhasePlate(surfaces.Quadratic(1 / 3), z=15 * mm),
        PhasePlate(surfaces.Tilt((0.1 / 3, 0)), z=15 * mm),
        PhasePlate(surfaces.Cubic(250 / 3), width=9 * mm, z=15 * mm),
        PhasePlate(surfaces.Axicon(-0.01), diameter=9 * mm, z=15 * mm),
        PhasePlate(surfaces.Zernike.from_terms({4: 200 * nm, 11: 100 / 3 * nm}, 20 * mm), z=15 * mm),
        PhasePlate(surfaces.HeightMap(RANDOM.random((4, 5)) * um, 9 * mm, refractive_index=1.6), z=16 * mm),
        PhasePlate(surfaces.PathMap(RANDOM.random((5, 4)) * um, 9 * mm, 8 * mm), z=16 * mm, name="measured path"),
        PhasePlate(surfaces.Rough(100 * nm, 50 * um, 2 * mm, seed=3), z=16 * mm),
        Biprism(0.1 / 3, 20 * deg, 9 * mm, z=17 * mm),
        Pyramid(4, -0.02, z=17 * mm),
        PrismArray(RANDOM.random((2, 3, 2)), 1 * mm, "hexagonal", focal_length=50 * mm, z=18 * mm),
        FirstOrder([[0.9, 1 / 99], [-20, 79 / 99 / 0.9]], 5 * mm, np.eye(2), 9 * mm, z=20 * mm),
        RealLens(
            Prescription(
                (
                    LensSurface(30 * mm, 4 * mm, 1.5, 9 * mm, conic=-0.5, aspheres=(1e3, -2e7), number=1),
                    LensSurface(-50 * mm, 1 * mm, 1.0, 9 * mm, material=None),
                    LensSurface(np.inf, 1 * mm, 1.0, 5 * mm, True),
                    LensSurface(40 * mm, 1 * mm, 1.6, 9 * mm, glass="F2", material=glasses.Abbe(1.62, 36.4)),
                    LensSurface(60 * mm, 0.0, 1.0, 9 * mm),
                ),
                "a lens",
                "lens.zmx",
                image_distance=30 * mm,
            ),
            mask=patterns.Polygon(5, 4 * mm),
            front=1 * mm,
            transmission=(0.99, 0.98, 1, 0.97, 0.96),
            z=31 * mm,
            radiometry="paraxial",
            softness=0.1 * mm,
            dispersion=False,
            fresnel=True,
        ),
        RayTableLens(RayTable(RANDOM.random((200, 8)), 1 / 3 * mm, 1 * um), "paraxial", z=40 * mm),
        FirstOrder(Affine.prism((0.1, 0)).matrix, entrance_diameter=3 * mm, exit_diameter=2 * mm, z=30 * mm),
        LensArray(125 * um, 1 / 3 * mm, z=49 * mm),
        LensArray(
            125 * um, (0.5 * mm, -math.inf, 1 / 3 * mm), "hexagonal", 1 * deg, (1e-5, 0), 0.5, True, z=49.5 * mm
        ),
        Louvre(1 * mm, 1 / 3 * mm, 0.1 * mm, 20 * deg, z=50 * mm),
        AngleFilter(AngularFringes(20 / 3, 0.1, 0.9, 0.2), z=50 * mm),
        AngleFilter(SoftRectangle(left=-0.1, bottom=1 / 3, ramp=0.01), z=50 * mm),
        AngleFilter(Gaps(0.1, 0.1 / 3), z=50 * mm),
        Lens(50 * mm, glass="N-BK7", design_wavelength=550 * nm, z=50 * mm),
        Prism((0.1, 0.0), glass=glasses.Cauchy(1.5046, 0.0042 * um**2, 1e-4 / 3 * um**4), z=50 * mm),
        PhasePlate(
            surfaces.Cubic(250.0), glass=glasses.Sellmeier((1.04, 0.23), (0.006 * um**2, 1e-11 / 3)), z=50 * mm
        ),
        LensArray(125 * um, 1 * mm, glass=glasses.Table((400 * nm, 0.7 * um), (1.53, 1.51)), z=51 * mm),
        Biprism(0.01, glass=glasses.Abbe(1.6, 30.0, (0.4 * um, 0.8 * um)), z=51 * mm),
        Pyramid(4, 0.01, glass=glasses.Catalogue("SCHOTT F2"), z=51 * mm),
        DiffractiveLens(50 * mm, 9 * mm, 532 * nm, (1, 0), (0.9, 0.1 / 3), z=51 * mm),
        Mask(RANDOM.random((2, 3, 2)), 10 * mm, spectrum=(FILTER, FILTER), z=51 * mm),
        Mask(by_channel.ByChannel((patterns.Circle(1 * mm), patterns.Open())), spectrum=FILTER, z=51 * mm),
    ],
    Sensor(
        52 * mm,
        (50, 40),
        (48 * um, 1e-6 / 3),
        (1e-3, -1e-9),
        fill_factor=0.1 / 3,
        electronics=COLOUR,
        response=((1 / 3, 0.5), FILTER, (0.0, 1.0)),
        photodiodes=(1, 2),
        microlens=Microlens(f_number=1.4, pupil_distance=math.inf, crosstalk=1e-6 / 3),
        angular_response=((AngularFringes(20.0), patterns.Circle(0.1 / 3)),),
    ),
)


def test_round_trip_is_exact(tmp_path):
    EVERYTHING.save(tmp_path / "everything.toml")
    back = load_camera(tmp_path / "everything.toml")
    assert back == EVERYTHING
    assert (back.name, EVERYTHING.name) == ("everything", "")
    assert CameraMark.of(back).hash == CameraMark.of(EVERYTHING).hash is not None
    assert {file.name for file in tmp_path.iterdir()} == {
        "everything.toml",
        "everything_coded_1.npy",
        "everything_coded_1_2.npy",
        "everything_mask_9.npy",
        "everything_mask_10.npy",
        "everything_measured.npy",
        "everything_mixed_weights.npy",
        "everything_coded_diffuser_21_widths.npy",
        "everything_phase_plate_27_heights.npy",
        "everything_measured_path_paths.npy",
        "everything_prism_array_32_slopes.npy",
        "everything_ray_table_lens_36_rays.npy",
        "everything_mask_50.npy",
        "everything_mask_50_2.npy",
    }


def test_every_kind_and_name_takes_part_in_the_round_trip():
    elements = EVERYTHING.elements
    assert {type(element) for element in elements} == set(ELEMENT_KINDS.values())
    used = {type(e.pattern) for e in elements if isinstance(e, Mask | AngleFilter)}
    used |= {type(part) for e in elements if isinstance(e, Mask) for part in getattr(e.pattern, "patterns", ())}
    assert used == set(PATTERN_NAMES.values())
    assert {type(e.kernel) for e in elements if isinstance(e, Diffuser)} == set(KERNEL_NAMES.values())
    assert {type(e.surface) for e in elements if isinstance(e, PhasePlate)} == set(SURFACE_NAMES.values())
    assert {type(getattr(e, "glass", None)) for e in elements} == {*GLASS_NAMES.values(), str, type(None)}


def test_names_are_those_of_the_classes():
    assert list(ELEMENT_KINDS) == [
        "angle_filter",
        "biprism",
        "coded_diffuser",
        "diffractive_lens",
        "diffuser",
        "first_order",
        "lens",
        "lens_array",
        "louvre",
        "mask",
        "phase_plate",
        "prism",
        "prism_array",
        "pyramid",
        "ray_table_lens",
        "real_lens",
    ]
    assert list(KERNEL_NAMES) == ["gaussian", "top_hat", "radial", "samples"]
    assert list(SURFACE_NAMES) == [
        "quadratic",
        "tilt",
        "cubic",
        "axicon",
        "zernike",
        "height_map",
        "path_map",
        "rough",
    ]


def test_reads_glasses_and_spectra(written):
    camera = written(one("lens", focal_length='"50 mm"', glass='{ name = "cauchy", A = 1.5, B = "0.0042 um2" }'))
    assert camera.elements[0].glass == glasses.Cauchy(1.5, 0.0042 * um**2)
    filters = 'spectrum = { wavelengths = ["400 nm", "700 nm"], values = [0, 1] }'
    camera = written(
        one("mask", pattern='{ name = "open" }').replace("[sensor]", filters + "\n[sensor]\nresponse='mono'")
    )
    assert camera.elements[0].spectrum == Spectrum((400 * nm, 700 * nm), (0.0, 1.0))
    assert camera.sensor.response == "mono"
    for wrong, message in (
        ('{ name = "abbe", nd = 1.5 }', r'glass \(abbe\) has no field "V"'),
        ("1.5", r'glass is 1.5: write a glass by name, like "N-BK7", or'),
        ('{ name = "cauchy", A = 1.5, B = 0.0042 }', r'B is 0.0042: an area needs a unit, .*"0.0042 um2"'),
        ('{ name = "cauchi" }', 'did you mean "cauchy"'),
    ):
        with pytest.raises(InputError, match=message):
            written(one("lens", focal_length='"50 mm"', glass=wrong))


def test_reads_kernels_and_surfaces_by_name(written):
    camera = written(one("diffuser", kernel='{ name = "Top Hat", width = 0.02, shape = "square" }'))
    assert camera.elements[0] == Diffuser(kernels.TopHat(0.02, "square"))
    camera = written(one("phase plate", surface='{ name = "cubic", strength = 250 }', diameter='"9 mm"'))
    assert camera.elements[0] == PhasePlate(surfaces.Cubic(250.0), diameter=9 * mm)
    camera = written(
        one(
            "phase_plate",
            surface='{ name = "zernike", coefficients = ["0 m", "0 m", "300 nm"], diameter = "9 mm" }',
        )
    )
    assert camera.elements[0] == PhasePlate(surfaces.Zernike((0, 0, 300 * nm), 9 * mm))


def test_reads_one_or_several_where_a_field_takes_both(written):
    gaussian, top_hat = '{ name = "gaussian", sigma = 0.1 }', '{ name = "top_hat", width = 0.2 }'
    sheet = {"width": '"4 mm"'}
    camera = written(one("coded_diffuser", kernels=gaussian, widths="[[0, 1], [1, 0.5]]", **sheet))
    assert camera.elements[0] == CodedDiffuser(kernels.Gaussian(0.1), 4 * mm, widths=np.array([[0, 1], [1, 0.5]]))
    weights = "[[[1, 0.5]], [[0, 0.5]]]"
    camera = written(one("coded_diffuser", kernels=f"[{gaussian}, {top_hat}]", weights=weights, **sheet))
    mixed = (kernels.Gaussian(0.1), kernels.TopHat(0.2))
    assert camera.elements[0] == CodedDiffuser(mixed, 4 * mm, weights=np.array([[[1, 0.5]], [[0, 0.5]]]))
    for written_as, focal_length in (('"1 mm"', 1 * mm), ('["1 mm", "2 mm", "3 mm"]', (1 * mm, 2 * mm, 3 * mm))):
        camera = written(one("lens_array", pitch='"1 mm"', focal_length=written_as))
        assert camera.elements[0] == LensArray(1 * mm, focal_length)


def test_reads_arrays_of_any_number_of_axes(tmp_path, written):
    slopes = RANDOM.random((2, 3, 2))
    np.save(tmp_path / "slopes.npy", slopes)
    camera = written(one("prism_array", slopes='"slopes.npy"', pitch='"1 mm"'))
    assert camera.elements[0] == PrismArray(slopes, 1 * mm)
    np.save(tmp_path / "kernel.npy", np.array([[1, 2], [3, 4]]))  # whole numbers are no shares of full scale here
    camera = written(one("diffuser", kernel='"kernel.npy"', slope_pitch="0.01", normalise="true"))
    assert camera.elements[0] == Diffuser(np.array([[1, 2], [3, 4.0]]) / 10, 0.01)
    (tmp_path / "kernel.png").write_bytes(imagecodecs.png_encode(np.array([[0, 51], [204, 0]], np.uint8)))
    camera = written(one("diffuser", kernel='"kernel.png"', slope_pitch="0.01"))
    assert camera.elements[0] == Diffuser(np.array([[0, 0.2], [0.8, 0]]), 0.01)


def test_arrays_of_lengths_in_files_are_in_metres(tmp_path, written):
    heights = np.arange(16.0).reshape(4, 4) * um
    np.save(tmp_path / "heights.npy", heights)
    np.savetxt(tmp_path / "heights.csv", heights, delimiter=",", fmt="%.17g")
    for file in ("heights.npy", "heights.csv"):
        camera = written(
            one("phase_plate", surface=f'{{ name = "height_map", heights = "{file}", width = "4 mm" }}')
        )
        assert camera.elements[0] == PhasePlate(surfaces.HeightMap(heights, 4 * mm))


@dataclass(frozen=True, eq=False)
class Steps(Element):
    """An element of one's own with an array of lengths."""

    heights: np.ndarray = field(metadata={"unit": "length"})

    def faces(self):
        return Faces()


def test_an_array_of_lengths_has_its_units_in_rows(tmp_path, written, monkeypatch):
    monkeypatch.setitem(ELEMENT_KINDS, "steps", Steps)
    (steps,) = written(one("steps", heights='[["1 um", "2 mm"], ["0 m", "3 nm"]]')).elements
    assert steps.heights.tolist() == [[1 * um, 2 * mm], [0, 3 * nm]]
    Camera([steps], Sensor(1 * mm, (2, 2), 1 * um)).save(tmp_path / "steps.toml")
    (read,) = load_camera(tmp_path / "steps.toml").elements
    assert np.array_equal(read.heights, steps.heights)
    (tmp_path / "grey.png").write_bytes(imagecodecs.png_encode(np.zeros((2, 2), np.uint8)))
    for rows, message in (
        ("[[0, 1], [1, 0]]", r"element 1 \(steps\): heights is 0: a length needs a unit"),
        ('[["1 um"], []]', r'heights is .*: it is the name of a file, or rows of .*, like \[\["1 um", "2 um"\]'),
        ('"grey.png"', r"heights is grey.png: only .npy and .csv hold numbers with a unit, in SI \(metres\)"),
    ):
        with pytest.raises(InputError, match=message):
            written(one("steps", heights=rows))


def test_a_sensor_with_electronics_is_a_table_of_its_own(written):
    camera = written(
        SENSOR + '[sensor.electronics]\nread_noise = 3\nwavelength = "600 nm"\ncolor_filter = "RGGB"\n'
    )
    assert camera.sensor.electronics == Electronics(read_noise=3.0, wavelength=600 * nm, color_filter="RGGB")
    assert written(SENSOR + "[sensor.electronics]\n").sensor.electronics == Electronics()


# --- a real lens ---

PRESCRIPTION = "# radius gap index diameter\n0 1 0 10\n50 5 1.5 20\n-60 0 1 20\n"  # millimetres


@pytest.fixture
def lens_file(tmp_path):
    (tmp_path / "glass.dat").write_text(PRESCRIPTION)
    return tmp_path / "glass.dat"


def test_reads_a_real_lens_from_its_file(lens_file, written):
    place = {"z": '"2 mm"', "decentre": '["1 mm", "0 mm"]', "name": '"prime"', "lens_file": '"glass.dat"'}
    (lens,) = written(one("first_order", **place)).elements
    expected = {"z": 2 * mm, "decentre": (1 * mm, 0.0), "name": "prime"}
    assert lens == load_lens(lens_file, **expected)
    assert lens.source == "glass.dat"
    (lens,) = written(one("first_order", f_number="8", rims="true", **place)).elements
    assert lens == load_lens(lens_file, f_number=8.0, rims=True, **expected)


def test_a_real_lens_keeps_its_file_where_that_gives_the_same(lens_file, tmp_path):
    first = tmp_path / "first.toml"
    lenses = [
        load_lens(lens_file),
        load_lens(lens_file, z=10 * mm, f_number=11, rims=True, name="stopped down"),
        load_lens(lens_file, z=20 * mm).reversed(),
        FirstOrder.thick_lens((50 * mm, -50 * mm), 5 * mm, 1.5, z=30 * mm),
    ]
    camera = Camera(lenses, Sensor(52 * mm, (3, 4), 1 * um))
    camera.save(first)
    assert first.read_text().count('lens_file = "glass.dat"') == 2
    assert load_camera(first) == camera
    lens_file.write_text(PRESCRIPTION.replace("50", "51"))  # another lens now: the matrix is what remains true
    camera.save(tmp_path / "second.toml")
    assert "lens_file" not in (tmp_path / "second.toml").read_text()
    assert load_camera(tmp_path / "second.toml") == camera
    lens_file.unlink()
    camera.save(tmp_path / "third.toml")
    assert load_camera(tmp_path / "third.toml") == camera


def test_a_stop_wider_than_that_of_the_lens_is_told_when_reading_and_not_when_saving(lens_file, tmp_path, written):
    with pytest.warns(ResultWarning, match="wider than that of the prescription"):
        camera = written(one("first_order", lens_file='"glass.dat"', stop_diameter='"15 mm"'))
    camera.save(tmp_path / "again.toml")
    assert 'lens_file = "glass.dat"' in (tmp_path / "again.toml").read_text()


length = some.floats(1e-9, 1e3)


@settings(max_examples=30)
@given(length, length, length, some.floats(-1e3, 1e3), some.floats(-10, 10))
def test_round_trip_of_any_numbers(tmp_path_factory, focal_length, z, pitch, offset, slope):
    file = tmp_path_factory.mktemp("any") / "camera.toml"
    elements = [Lens(focal_length, decentre=(offset, -offset)), Prism((slope, 0))]
    camera = Camera(elements, Sensor(z, (3, 4), pitch))
    save_camera(camera, file)
    assert load_camera(file) == camera


def test_a_mask_keeps_its_file_where_that_is_within_reach(tmp_path):
    (tmp_path / "mask.csv").write_text("0,1\n0.1,1\n")
    (tmp_path / "one.toml").write_text(
        f'[[elements]]\nkind = "mask"\nwidth = "1 mm"\npattern = "mask.csv"\n{SENSOR}'
    )
    camera = load_camera(tmp_path / "one.toml")
    save_camera(camera, tmp_path / "two.toml")
    assert 'pattern = "mask.csv"' in (tmp_path / "two.toml").read_text()
    (tmp_path / "elsewhere").mkdir()
    save_camera(camera, tmp_path / "elsewhere" / "three.toml")
    assert load_camera(tmp_path / "elsewhere" / "three.toml") == camera


def test_a_camera_without_elements(tmp_path):
    camera = Camera([], Sensor(1 * mm, (2, 3), 1 * um))
    save_camera(camera, tmp_path / "pinhole.toml")
    assert load_camera(tmp_path / "pinhole.toml") == camera


def mask(pattern):
    return LENS + element("mask", name='"code"', width='"1 mm"', pattern=pattern) + SENSOR


MASK = r'element 2 \(mask "code"\): pattern'


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        (LENS + "[sensor\n", r"camera.toml is not valid TOML: .*line 5"),
        (LENS, r'camera.toml has no table "sensor"'),
        ("sensor = 5", r"the sensor is a table that starts with a line \[sensor\]"),
        ("[elements]\nz = 1\n" + SENSOR, r"each element starts with a line \[\[elements\]\]"),
        ("[[element]]\nz = 1\n" + SENSOR, r'unknown table "element": did you mean "elements"\?'),
        (element(None) + SENSOR, 'element 1 has no kind: add kind = … with one of "angle_filter", "biprism'),
        (element("stop") + SENSOR, 'element 1: kind "stop" is not known; known are "angle_filter", "biprism", '),
        (one("lens", z="true", focal_length='"5 mm"'), r"element 1 \(lens\): z is true: a length needs a unit"),
        (one("mask", pattern="[[0, 1]]"), r'give its width, e.g. width = "30 mm"'),
        (
            mask('"circle"'),
            r'there is no file "circle" in .*; a pattern is written by name: \{ name = "circle"',
        ),
        (element("lense") + SENSOR, 'element 1: kind "lense" is not known: did you mean "lens"'),
        (element("xyz") + SENSOR, 'kind "xyz" is not known; known are "angle_filter", .*"real_lens"$'),
        ("[[elements]]\nkind = 5\n" + SENSOR, "element 1: kind is 5: write it as text"),
        (LENS + element() + SENSOR, r'element 2 \(lens\) has no field "focal_length"'),
        (
            element(name='"L1"', focal_lenght='"5 mm"') + SENSOR,
            r'element 1 \(lens "L1"\) has an unknown field "focal_lenght": did you mean "focal_len',
        ),
        (
            element(focal_length=50) + SENSOR,
            r"camera.toml: element 1 \(lens\): focal_length is 50: a length needs a unit",
        ),
        (element(focal_length='"50"') + SENSOR, 'focal_length is "50": a length needs a unit'),
        (element(focal_length='"5 s"') + SENSOR, 'focal_length is "5 s", which is not a length'),
        (element(focal_length='["5 mm"]') + SENSOR, "focal_length is .*: a length needs a unit"),
        (element(focal_length='"0 mm"') + SENSOR, "element 1 .*: focal_length of lens .* not be 0"),
        (
            element(focal_length='"5 mm"', decentre='"1 mm"') + SENSOR,
            r'decentre is "1 mm": it is a list of 2, like \["1 mm", "1 mm"\]',
        ),
        (
            element(focal_length='"5 mm"', decentre='["1 mm", 2]') + SENSOR,
            "decentre, number 2 of 2, is 2: a length needs a unit",
        ),
        (element(focal_length='"5 mm"', name=5) + SENSOR, "name is 5: it is text in quotes"),
        (element("prism", deflection="[1, '0']") + SENSOR, 'number 2 of 2, is "0": it is a number'),
        (
            LENS + '[sensor]\nz = "52 mm"\nshape = 500\npitch = "1 um"',
            r"shape is 500: it is a list of 2, like \[200, 200\]",
        ),
        (LENS.replace("0 mm", "60 mm") + SENSOR, "camera.toml: .* stands behind the sensor"),
        (mask('"lost.png"'), MASK + ': there is no file "lost.png" in '),
        (mask('"camera.toml"'), MASK + r": .*camera.toml has the ending \".toml\""),
        (mask("[[0, 1], [1]]"), MASK + r" is .*rows of equally many numbers"),
        (mask("5"), MASK + r" is 5: it is the name of a file"),
        (mask("[[0, 2]]"), r'element 2 \(mask "code"\): .*between 0 and 1'),
        (mask("{ diameter = '5 mm' }"), MASK + ' has no name: add name = … with one of "open"'),
        (mask("{ name = 'circel' }"), MASK + ': name "circel" is not known: did you mean "circle"'),
        (mask("{ name = 'circle' }"), MASK + r' \(circle\) has no field "diameter"'),
        (mask("{ name = 'circle', diameter = 5 }"), MASK + r" \(circle\): diameter is 5: a length"),
        (mask("{ name = 'mura', prime = 9 }"), MASK + ": a MURA has a prime number"),
        (mask("{ name = 'mura', prime = 9.5 }"), r"prime is 9.5: it is a whole number"),
        (
            mask("{ name = 'bounded', width = '1 mm', height = '1 mm', pattern = 'a.png' }"),
            r'pattern \(bounded\): pattern is "a.png": write a pattern by name',
        ),
        (
            LENS + SENSOR.replace("48 um", "0 um"),
            r"camera.toml: sensor: the sensor's pitch must be greater than 0 m",
        ),
        (LENS + SENSOR.replace('"48 um"', "48"), "sensor: pitch is 48: a length needs a unit"),
        (
            LENS + SENSOR.replace("500", "500.5"),
            "sensor: shape, number 1 of 2, is 500.5: it is a w",
        ),
        (LENS + SENSOR.replace("pitch", "pich"), 'sensor has an unknown field "pich": .*"pitch"'),
        (one("diffuser", kernel="0.1"), r"\(diffuser\): kernel is 0.1: it is the name of a file, or rows of eq"),
        (one("diffuser", kernel='{ name = "gausian", sigma = 1 }'), 'kernel: name "gausian" .* mean "gaussian"'),
        (
            one("diffuser", kernel='{ name = "mura", prime = 7 }'),
            'kernel: name "mura" is not known; known are "gauss',
        ),
        (one("diffuser", kernel='{ name = "gaussian", sigma = "1 mm" }'), 'sigma is "1 mm": it is a number$'),
        (
            one("diffuser", kernel='{ name = "gaussian", sigma = [1, 2, 3] }'),
            r"sigma is .*a list of 2, like \[0, 0\]",
        ),
        (
            one("diffuser", kernel='{ name = "gaussian", sigma = -1 }'),
            r"kernel \(gaussian\): sigma of a Gaussian is",
        ),
        (one("diffuser", kernel="[[1, 2]]", slope_pitch="0.1"), r"element 1 \(diffuser\): .* sums to 3"),
        (
            one("coded_diffuser", kernels='[{ name = "gaussian", sigma = "x" }]', width='"1 mm"'),
            r'kernels, number 1 of 1, \(gaussian\): sigma is "x": it is a number',
        ),
        (
            one("coded_diffuser", kernels='"x"', width='"1 mm"'),
            r'kernels is "x": write a kernel by name, like \{ name',
        ),
        (
            one("phase_plate", surface='"x.png"'),
            r'surface is "x.png": write a surface by name, like \{ name = "cubic',
        ),
        (
            one("phase_plate", surface="{ strength = 1 }"),
            'surface has no name: add name = … with one of "quadratic"',
        ),
        (
            one("phase_plate", surface='{ name = "zernike", coefficients = "1 um", diameter = "1 mm" }'),
            r'coefficients is "1 um": it is a list, like \["1 mm", "1 mm"\]',
        ),
        (
            one("phase_plate", surface='{ name = "zernike", coefficients = ["1 um", 2], diameter = "1 mm" }'),
            r"surface \(zernike\): coefficients, number 2 of 2, is 2: a length needs a unit",
        ),
        (
            one("lens_array", pitch='"1 mm"', focal_length='["1 mm", 2]'),
            "focal_length, number 2 of 2, is 2: a length",
        ),
        (one("lens_array", pitch='"1 mm"', focal_length="[]"), "focal_length of lens array .* is an empty list"),
        (
            one("lens_array", pitch='"1 mm"', focal_length='"1 mm"', circular="1"),
            "circular is 1: it is true or false",
        ),
        (
            one("lens_array", pitch='"1 mm"', focal_length='"1 mm"', layout='"hex"'),
            "layout is 'square' or 'hexagonal'",
        ),
        (one("pyramid", sides="4.5", deflection="0.1"), "sides is 4.5: it is a whole number"),
        (one("first_order", length='"1 mm"'), r'\(first_order\) has no field "matrix", and no "lens_file" that'),
        (one("first_order", matrix="[[1, 0]]"), r"element 1 \(first_order\): matrix of first order .* is 1×2"),
        (one("first_order", matrix="[[1, 0], [0, 2]]"), r"element 1 \(first_order\): .* determinant 2, not 1"),
        (
            one("first_order", matrix="[[1, 0], [0, 1]]", lens_file='"a.dat"'),
            r"\(first_order\) has a lens_file and a matrix: the file gives the matrix, leave one out",
        ),
        (
            one("first_order", lens_file='"a.dat"'),
            r"\(first_order\): lens_file: there is no lens prescription .*a.dat",
        ),
        (
            one("first_order", lens_file='"camera.toml"'),
            "lens_file: .* is not a lens prescription that can be read",
        ),
        (one("first_order", lens_file="5"), "lens_file is 5: it is text in quotes"),
        (one("first_order", lens_file='"a.dat"', f_numer="2"), 'unknown field "f_numer": did you mean "f_number"'),
        (one("first_order", lens_file='"a.dat"', glasses="5"), "glasses is 5: it is a table of fields"),
        (one("first_order", lens_file='"a.dat"', glasses='{ K7 = "x" }'), 'glasses: K7 is "x": it is a number'),
        (SENSOR + "electronics = 5\n", "sensor: electronics is 5: it is a table of fields"),
        (
            SENSOR + "[sensor.electronics]\nwell = 5\n",
            'sensor: electronics has an unknown field "well"; known are "quantum_efficiency", ',
        ),
        (
            SENSOR + "[sensor.electronics]\nwavelength = 5e-7\n",
            "electronics: wavelength is 5e-07: a length needs a",
        ),
        (
            SENSOR + "[sensor.electronics]\nfull_well = 0\n",
            "camera.toml: sensor: electronics: full_well must be greater than 0 electrons, not 0.0",
        ),
        (SENSOR + "[sensor.electronics]\ncolor_filter = 5\n", "color_filter is 5: it is text in quotes"),
    ],
)
def test_says_what_is_wrong_and_where(written, toml, message):
    with pytest.raises(InputError, match=message):
        written(toml)


def test_a_mask_file_that_cannot_be_read(tmp_path, written):
    (tmp_path / "broken.npy").write_bytes(b"no array")
    with pytest.raises(InputError, match=MASK + r": .*broken.npy cannot be read as a NumPy array"):
        written(mask('"broken.npy"'))
    np.save(tmp_path / "complex.npy", np.array([[1j]]))
    with pytest.raises(InputError, match=MASK + r": .*complex.npy holds complex128, not real numbers"):
        written(mask('"complex.npy"'))


def test_no_such_file_and_no_text(tmp_path):
    with pytest.raises(InputError, match=r"there is no camera file .*lost\.toml"):
        load_camera(tmp_path / "lost.toml")
    with pytest.raises(InputError, match=r"there is no camera file .*: it is a folder"):
        load_camera(tmp_path)
    (tmp_path / "picture.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        load_camera(tmp_path / "picture.toml")


def test_a_function_cannot_be_written(tmp_path):
    def striped(x, y):
        return (x > 0) * 1.0 + 0 * y

    def bent(x, y):
        return -x, -y

    for piece, message in (
        (
            Mask(striped, 1 * mm, name="m"),
            r'pattern of mask "m" is striped, .*Use a pattern of .*sample it on a grid',
        ),
        (
            PhasePlate(bent, name="p"),
            r'surface of phase plate "p" is bent, a piece of Python .*Use a surface of vcc.surfaces .*PathMap\(',
        ),
    ):
        with pytest.raises(InputError, match=message):
            save_camera(Camera([piece], Sensor(1 * mm, (2, 2), 1 * um)), tmp_path / "camera.toml")
    assert not list(tmp_path.iterdir())


@dataclass(frozen=True)
class Exponential(kernels.Gaussian):
    """A kernel of one's own, as far as a file is concerned."""


def test_a_kernel_of_ones_own(tmp_path, monkeypatch):
    camera = Camera(
        [
            Diffuser(Exponential(0.1)),
            CodedDiffuser((Exponential(0.1), kernels.Gaussian(1.0)), 1 * mm, np.full((2, 1, 1), 0.5)),
        ],
        Sensor(1 * mm, (2, 2), 1 * um),
    )
    for part in camera.elements:
        message = (
            rf"the kernel of {part.label} is a Exponential, .*Gaussian.*vcc.camera_file.KERNEL_NAMES.*Samples\("
        )
        with pytest.raises(InputError, match=message):
            save_camera(Camera([part], camera.sensor), tmp_path / "camera.toml")
    monkeypatch.setitem(KERNEL_NAMES, "exponential", Exponential)
    save_camera(camera, tmp_path / "camera.toml")
    assert load_camera(tmp_path / "camera.toml") == camera


@dataclass(frozen=True)
class Mount:
    """Parameters that belong together, which a user keeps in a dataclass."""

    turn: float = field(default=0.0, metadata={"unit": "angle"})
    screws: tuple[str, ...] = ()
    parts: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Stack(Element):
    """An element of one's own with fields of all sorts."""

    step: Affine
    table: np.ndarray = field(default_factory=lambda: np.zeros(2))
    mount: Mount = Mount()
    others: tuple[kernels.Kernel | patterns.Pattern, ...] = ()

    def faces(self):
        return Faces()


def test_an_element_of_ones_own_with_fields_of_all_sorts(tmp_path, monkeypatch):
    monkeypatch.setitem(ELEMENT_KINDS, "stack", Stack)
    sensor = Sensor(1 * mm, (2, 2), 1 * um)
    mount = Mount(20 * deg, ("left", "right"), {"nut": 1 / 3})
    circle = patterns.Circle(1 * mm)
    for stack in (
        Stack(Affine.lens(3.0), mount=mount),
        Stack(Affine.identity(2), np.eye(3), others=(circle,)),
        Stack(Affine.identity(2), np.zeros(2)),
    ):
        Camera([stack], sensor).save(tmp_path / "own.toml")
        (read,) = load_camera(tmp_path / "own.toml").elements
        assert (read.step, read.mount, read.others) == (stack.step, stack.mount, stack.others)
        assert np.array_equal(read.table, stack.table)
    assert "table" not in (tmp_path / "own.toml").read_text()  # it has its default, an array
    (tmp_path / "own.toml").write_text('[[elements]]\nkind = "stack"\nstep = [[1, 0], [0, 2]]\n' + SENSOR)
    with pytest.raises(InputError, match=r"element 1 \(stack\): step: an affine map is a 5×5 or 3×3 matrix"):
        load_camera(tmp_path / "own.toml")


def test_what_no_file_can_hold(tmp_path, monkeypatch):
    monkeypatch.setitem(ELEMENT_KINDS, "stack", Stack)
    for part, said in ((print, "the function print"), ({1}, "a set")):
        camera = Camera([Stack(Affine.identity(), mount=part)], Sensor(1 * mm, (2, 2), 1 * um))
        with pytest.raises(InputError, match=rf"mount of stack at z = 0 mm is {said}, which a camera file cannot"):
            camera.save(tmp_path / "own.toml")


def test_elements_of_ones_own(tmp_path, monkeypatch):
    @dataclass(frozen=True)
    class CylinderLens(Element):
        focal_length: float = field(metadata={"unit": "length"})
        turn: float = field(default=0.0, metadata={"unit": "angle"})

        def faces(self):
            return Faces(Affine.lens(self.focal_length))

    camera = Camera([CylinderLens(5 * mm, 20 * deg)], Sensor(1 * mm, (2, 2), 1 * um))
    with pytest.raises(InputError, match=re.escape("Add its class to vcc.camera_file.ELEMENT_KINDS")):
        save_camera(camera, tmp_path / "camera.toml")
    monkeypatch.setitem(ELEMENT_KINDS, "cylinder_lens", CylinderLens)
    save_camera(camera, tmp_path / "camera.toml")
    assert 'turn = "20 deg"' in (tmp_path / "camera.toml").read_text()
    assert load_camera(tmp_path / "camera.toml") == camera


def test_a_folder_that_does_not_exist(tmp_path):
    with pytest.raises(InputError, match="there is no folder"):
        save_camera(EVERYTHING, tmp_path / "lost" / "camera.toml")
