"""``vcc dataset``: recordings with ground truth, for training."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from vcc.base.errors import InputError
from vcc.camera_file import load_camera
from vcc.cli.console import progress, show
from vcc.cli.executing import Who, opened
from vcc.cli.options import (
    CameraFile,
    Counts,
    Making,
    Number,
    Output,
    Whole,
    above_zero,
    duration,
    length,
    quantity,
)
from vcc.cli.sweep import by_name, setting
from vcc.dataset import make_dataset
from vcc.dataset.making import Kind as Files
from vcc.sweeps import Design
from vcc.sweeps.design import Kind

DRAWING = Group("What is drawn for each pair", sort_key=1.2)
TRUTH = Group("Ground truth", sort_key=1.4)
Times = float | tuple[float, float] | Literal["auto"]


def _times(text: str, option: str) -> Times:
    """Seconds of one time, (low, high) of two with a colon between them, or "auto".

    Raises:
        InputError: no unit, or not a time.
    """
    if text == "auto":
        return "auto"
    parts = [duration(part, option) for part in text.split(":")]
    if len(parts) > 2:
        raise InputError(f'{option} is "{text}": one time, two with a colon between them ("1ms:20ms"), or auto')
    return parts[0] if len(parts) == 1 else (parts[0], parts[1])


def _distances(text: str, option: str) -> tuple[float, ...]:
    return tuple(length(part, option) for part in text.split(","))


Factors = Annotated[tuple[float, float], quantity("LOW HIGH", above_zero, tokens=2)]


@Parameter(name="*", group=DRAWING)
@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What is drawn for each pair, from the seed and its number alone.

    Args:
        set: A parameter of the camera and its values, as in vcc sweep: "code.pattern=mura,circle",
            "sensor.z=50mm:54mm:9", "sensor.electronics.read_noise=1,2,4". May be repeated.
        design: grid: every combination; list: the first values of all, then the second; random, sobol: drawn
            from intervals, "sensor.z=50mm:54mm". Each pair has one of these cameras.
        cameras: Number of cameras that random and sobol draw. Default: 64.
        crop: Rows and columns of a window at a random place of the sensor. Default: the whole sensor.
        flips: Mirror the scene and the camera, with probability 1/2 along each axis. The noise is not mirrored.
        gain: Factor of the light before the noise, from LOW to HIGH, uniform in its logarithm.
        color_gain: Likewise, another one for each channel.
        exposure: Exposure time, "10 ms", or from one to another, "1ms:20ms".
        radiance: Of a sample value of 1, W/(m²·sr).
        seed: Of everything that is drawn.
    """

    set: Annotated[tuple[tuple[str, str], ...] | None, quantity("NAME=VALUES", setting, repeated=True)] = None
    design: Kind = "grid"
    cameras: Whole | None = None
    crop: Counts | None = None
    flips: bool = False
    gain: Factors | None = None
    color_gain: Factors | None = None
    exposure: Annotated[Times, quantity("auto|TIME|TIME:TIME", _times)] = "auto"
    radiance: Number = 1.0
    seed: Whole = 0

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of `make_dataset`."""
        names = ("crop", "flips", "gain", "color_gain", "exposure", "radiance", "seed")
        return {name: getattr(self, name) for name in names}

    def cameras_of(self, folder: Path) -> Design:
        """The design of the cameras.

        Raises:
            InputError: a parameter that is given twice; see also `vcc.sweeps.Design`.
        """
        drawn = self.design in ("random", "sobol")
        return Design(by_name(self.set or ()), self.design, self.cameras, self.seed if drawn else 0, folder)


@Parameter(name="*", group=TRUTH)
@dataclass(frozen=True, kw_only=True)
class Truth:
    """Ground truth, on the same pixels as the recordings.

    Args:
        sharp: The all-in-focus image (default, unless something else is given).
        depth: Distance along the axis, metres.
        views: The light field over the window.
        psf: Point spreads at these distances, "0.8 m, 2 m".
        psf_size: Pixels along a side of a point spread, odd.
    """

    sharp: bool = False
    depth: bool = False
    views: bool = False
    psf: Annotated[tuple[float, ...] | None, quantity("LENGTH,…", _distances)] = None
    psf_size: Whole = 31

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of `make_dataset`."""
        asked = [name for name in ("sharp", "depth", "views", "psf") if getattr(self, name)] or ["sharp"]
        return {"truth": asked, "psf_distances": self.psf or (), "psf_size": self.psf_size}


def dataset(
    camera: CameraFile,
    /,
    *scenes: Annotated[Path, Parameter(help="Stores of light fields or videos, whose frames are scenes.")],
    output: Output,
    count: Whole = 1000,
    per_shard: Whole = 100,
    kind: Files = "webdataset",
    licence: Annotated[str | None, Parameter(metavar="TEXT")] = None,
    drawing: Drawing = Drawing(),
    truth: Truth = Truth(),
    how: Making = Making(),
    executor: Who = "processes",
) -> None:
    """Make pairs of recordings and ground truth, for training.

    Each pair has a camera of the design, a window of its sensor, an exposure and noise of its own. The card,
    README.md, says how the set was made.

    Examples:
        vcc dataset camera.toml scene.zarr -o pairs --set "code.pattern=mura,circle" --count 400 --crop 256 256
        vcc dataset camera.toml one.zarr two.zarr -o pairs --set "sensor.z=50mm:54mm" --design sobol --cameras
            512 --sharp --depth --flips --exposure "1ms:20ms"

    Args:
        output: A new folder for the pairs and the card; the same command resumes an interrupted run.
        count: Number of pairs.
        per_shard: Number of pairs in a shard, which one task makes.
        kind: Files of the pairs: `webdataset`, tar files; `zarr`, a Zarr group.
        licence: Of the data set, for its card.
        executor: What makes the shards: `processes` or `threads`, one per core of this machine, or a Dask cluster
            by its scheduler, "dask://host:8786", whose workers see the same disk. Each task uses one thread.
            `none`: one pair after the other.
    """
    if not scenes:
        raise InputError("give at least one scene, a store: vcc dataset camera.toml scene.zarr -o pairs")
    optics = load_camera(camera)
    options = {
        **drawing.options,
        **truth.options,
        "count": count,
        "per_shard": per_shard,
        "kind": kind,
        "licence": licence or "",
    }
    with opened(executor) as running, progress("Recording pairs") as advance:
        made = make_dataset(
            output,
            optics,
            list(scenes),
            drawing.cameras_of(camera.parent),
            how,
            executor=running,
            progress=advance,
            **options,
        )
    size = sum(each.stat().st_size for each in made.path.rglob("*") if each.is_file())
    arrays = ", ".join(f"{name} {'×'.join(map(str, each['shape']))}" for name, each in made.card["arrays"].items())
    show(f"{made.path}: {len(made)} pairs, {made.card['shards']} shards, {size / 1e6:.3g} MB; {arrays}")
