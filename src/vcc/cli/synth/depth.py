"""``vcc synth depth``: views around one picture, from its depth map."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from cyclopts import Group, Parameter
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.cli.console import show
from vcc.cli.options import Counts, Length
from vcc.cli.synth.rendering import RenderedBy, SampleType, Store, Views, check_store, make
from vcc.files.images_with_metadata import light_in
from vcc.files.netpbm import read_pfm
from vcc.files.pictures import read_picture, refuse_coded
from vcc.sources.depth_map import DepthMapScene


@Parameter(name="*", group=Group("Reading the picture", sort_key=4))
@dataclass(frozen=True, kw_only=True)
class ReadingDepth:
    """How the picture and its depth are read.

    Args:
        meaning: Whether DEPTH contains distances, or disparities in pixels per view, positive nearer than the
            convergence.
        depth_unit: The length of a value of 1 in DEPTH, "1 mm" in most 16-bit files.
        transfer: Encoding of integers in PICTURE; auto: as the file states, srgb if it does not.
    """

    meaning: Literal["depth", "disparity"] = "depth"
    depth_unit: Length = 1.0
    transfer: Literal["auto", "srgb", "linear"] = "auto"

    def picture(self, path: Path) -> NDArray[np.float32]:
        """Linear light, (rows, columns, channels)."""
        return light_in(path, self.transfer)


@dataclass(frozen=True, kw_only=True)
class ViewsOfPicture(Views):
    """Where the views are.

    Args:
        focus_distance: Where the views converge, "1.3 m", or inf for parallel. Default: in the middle of the
            scene.
    """

    views: Counts = (9, 9)
    focus_distance: Length | None = None


def depth(
    picture: Path,
    depth: Path,
    /,
    *,
    output: Store,
    where: ViewsOfPicture = ViewsOfPicture(),
    reading: ReadingDepth = ReadingDepth(),
    executor: RenderedBy = None,
    dtype: SampleType = "float16",
) -> None:
    """Make the views around a picture from its depth; hidden parts behind edges are filled in.

    Examples:
        vcc synth depth room.png room-depth.exr -o room.zarr --field-of-view "60 deg"
        vcc synth depth kinect.png kinect-depth.png -o out.zarr --depth-unit "1 mm"
        vcc synth depth view.png disparity.pfm -o out.zarr --meaning disparity --focus-distance "4 m"

    Args:
        picture: The middle view.
        depth: Of the same pixels: .exr, .pfm, .npy, .tif or 16-bit .png; one channel.
    """
    output = check_store(output)
    radiance, found = reading.picture(picture), _depth_samples(depth)
    if found.shape != radiance.shape[:2]:
        raise InputError(
            f"{depth} has {found.shape[1]}×{found.shape[0]} pixels, and {picture} has "
            f"{radiance.shape[1]}×{radiance.shape[0]}: they must be of the same pixels"
        )
    pixels = (radiance.shape[0], radiance.shape[1])
    if reading.meaning == "disparity":
        if where.focus_distance is None:
            raise InputError("disparities are relative to the convergence of the views: give --focus-distance")
        cameras = where.cameras(pixels=pixels)
        scene = DepthMapScene.from_disparity(radiance, found, cameras)
    else:
        distances = found * reading.depth_unit
        _check_distances(distances, depth)
        middle = 2 / (1 / distances.min() + 1 / distances.max())
        cameras = where.cameras(pixels=pixels, focus_distance=float(middle))
        scene = DepthMapScene.for_cameras(radiance, distances, cameras)
    make(scene, cameras, output, dtype, executor)
    corner = scene.uncovered(cameras.camera(0, 0))
    show(f"{float(corner.mean()):.1%} of the corner view was filled in: behind edges and beyond the border")


def _check_distances(distances: NDArray[np.float64], path: Path) -> None:
    bad = ~(distances > 0)
    if bad.any():
        row, column = (int(n) for n in np.argwhere(bad)[0])
        raise InputError(
            f"{path} has no distance in {bad.sum()} pixels, the first at row {row}, column {column} "
            f"({distances[row, column]:g} m): fill them first"
        )


def _depth_samples(path: Path) -> NDArray[np.float64]:
    """The numbers of a depth map as they are stored, (rows, columns).

    Raises:
        InputError: a file that cannot be read, or one with channels that differ.
    """
    if path.suffix.lower() == ".pfm":
        return read_pfm(path).astype(np.float64)
    refuse_coded(path, "a depth map holds distances or disparities")
    samples = np.asarray(read_picture(path)[0], dtype=np.float64)
    if samples.ndim == 3:
        if not (samples == samples[..., :1]).all():
            raise InputError(
                f"{path} has {samples.shape[2]} channels that differ: a depth map has one number a pixel"
            )
        samples = samples[..., 0]
    return samples
