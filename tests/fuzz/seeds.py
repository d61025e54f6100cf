"""Seeds: a small valid file or folder of each format, made here, which mutations then damage."""

from __future__ import annotations

import hashlib
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import h5py
import imagecodecs
import numpy as np
import OpenEXR
import tifffile
from numpy.typing import NDArray
from scipy.io import savemat

import vcc
from tests.fuzz.texts import CAMERA, HCI_CAMERA, LENS, MITSUBA_SCENE, MOVING, PBRT_SCENE
from tests.sources.splat_bytes import gltf, packed_ply, spz
from tests.sources.splat_clouds import cloud
from vcc.dataset import make_dataset
from vcc.sources.splats import write_ply
from vcc.store import Lossy, create_video, save_store

Maker = Callable[[Path], Any]
"""Fills a folder."""
Views = NDArray[Any]


def scene(
    rows: int = 3,
    columns: int = 3,
    height: int = 24,
    width: int = 32,
    channels: int | None = 3,
    kind: Any = np.uint8,
) -> Views:
    """Views of a smooth texture in front of another, parallax of one pixel per view."""
    rng = np.random.default_rng(7)
    wide = rng.random((height + 16, width + 16, channels or 1))
    for _ in range(2):
        wide = (wide + np.roll(wide, 1, 0) + np.roll(wide, 1, 1) + np.roll(wide, (1, 1), (0, 1))) / 4
    wide = (wide - wide.min()) / (wide.max() - wide.min())
    out = np.empty((rows, columns, height, width, channels or 1))
    for j in range(rows):
        for i in range(columns):
            out[j, i] = wide[4 + j : 4 + j + height, 4 + i : 4 + i + width]
    if channels is None:
        out = out[..., 0]
    return out.astype(kind) if np.dtype(kind).kind == "f" else np.rint(out * np.iinfo(kind).max).astype(kind)


def light_field(**how: Any) -> vcc.LightField:
    return vcc.LightField.from_views(scene(**how), spacing=1e-3, slope_per_pixel=1e-3, focus_distance=2.0)


def png(values: Views, **how: Any) -> bytes:
    return imagecodecs.png_encode(np.ascontiguousarray(values), **how)


def picture(path: Path, values: Views) -> None:
    """One picture, by its ending."""
    ending = path.suffix
    if ending == ".png":
        path.write_bytes(png(values))
    elif ending == ".jpg":
        path.write_bytes(imagecodecs.jpeg8_encode(values, level=90))
    elif ending == ".bmp":
        path.write_bytes(imagecodecs.bmp_encode(values))
    elif ending == ".ppm":
        top = 1023 if values.dtype == np.uint16 else 255
        data = (values.astype(">u2") >> 6).astype(">u2") if values.dtype == np.uint16 else values
        path.write_bytes(b"P6\n%d %d\n%d\n" % (values.shape[1], values.shape[0], top) + data.tobytes())
    elif ending == ".tif":
        tifffile.imwrite(path, values, photometric="rgb", compression="zlib", metadata=None)
    elif ending == ".exr":
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        planes = {n: np.ascontiguousarray(values[..., k]) for k, n in enumerate("RGB")}
        with OpenEXR.File(header, planes) as file:
            file.write(str(path))
    elif ending == ".npy":
        np.save(path, values)
    else:
        raise ValueError(ending)


def grid(folder: Path, name: str, ending: str, kind: Any = np.uint8, size: tuple[int, int] = (3, 3)) -> None:
    views = scene(*size, kind=kind)
    for j, i in np.ndindex(*size):
        picture(folder / (name.format(r=j, c=i, n=j * size[1] + i, y=-10.5 + j, x=3.25 + i) + ending), views[j, i])


def with_camera_file(name: str) -> Maker:
    def make(folder: Path) -> None:
        grid(folder, name, ".png")
        (folder / "parameters.cfg").write_text(HCI_CAMERA)

    return make


def cambridge(folder: Path) -> None:
    grid(folder, "{r:02d}_{c:02d}", ".png")
    (folder / "param.txt").write_text("num_x: 3\nnum_y: 3\nbase_x: 0.1\nbase_y: 0.1\n")
    np.save(folder / "disparity.npy", np.linspace(0, 1, 24 * 32, dtype=np.float32).reshape(24, 32))


def colmap(ending: str) -> Maker:
    """A row of five photographs before a wall of points."""

    def make(folder: Path) -> None:
        (folder / "images").mkdir()
        grid(folder / "images", "v{n}", ".png", size=(1, 5))
        if ending == ".txt":
            (folder / "cameras.txt").write_text("# cameras\n1 OPENCV 32 24 40 40 16 12 -0.1 0.01 0 0\n")
            lines = [f"{n + 1} 1 0 0 0 {-0.1 * n} 0 0 1 v{n}.png\n1.5 2.5 -1\n" for n in range(5)]
            (folder / "images.txt").write_text("".join(lines))
            (folder / "points3D.txt").write_text("1 0 0 2 9 9 9 0.5 1 1\n2 0.1 0 3 9 9 9 0.5 1 1\n")
            return
        lens = struct.pack("<QIiQQ8d", 1, 1, 4, 32, 24, 40, 40, 16, 12, -0.1, 0.01, 0, 0)
        (folder / "cameras.bin").write_bytes(lens)
        data = struct.pack("<Q", 5)
        for n in range(5):
            data += struct.pack("<I7dI", n + 1, 1, 0, 0, 0, -0.1 * n, 0, 0, 1) + f"v{n}.png\0".encode()
            data += struct.pack("<QddQ", 1, 1.5, 2.5, 2**64 - 1)
        (folder / "images.bin").write_bytes(data)
        data = struct.pack("<Q", 2)
        for n in range(2):
            data += struct.pack("<Q3d3BdQII", n, 0.1 * n, 0, 2 + n, 9, 9, 9, 0.5, 1, 1, 1)
        (folder / "points3D.bin").write_bytes(data)

    return make


def transforms(folder: Path) -> None:
    grid(folder, "v{n}", ".png", size=(1, 5))
    matrices = [[[1, 0, 0, 0.1 * n], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] for n in range(5)]
    frames = [{"file_path": f"v{n}", "transform_matrix": matrix} for n, matrix in enumerate(matrices)]
    (folder / "transforms.json").write_text(json.dumps({"camera_angle_x": 0.7, "k1": -0.1, "frames": frames}))


def views_csv(folder: Path) -> None:
    grid(folder, "v{n}", ".png")
    lines = ["row,col,file"] + [f"{n // 3},{n % 3},v{n}.png" for n in range(9)]
    (folder / "views.csv").write_text("\n".join(lines) + "\n")


def viewer_xml() -> str:
    views = "".join(
        f'  <subaperture src="v{n}.png" u="{10.0 * (n % 3)}" v="{10.0 * (n // 3)}" />\n' for n in range(9)
    )
    return f"<lightfield>\n{views}</lightfield>\n"


def viewer_folder(folder: Path) -> None:
    grid(folder, "v{n}", ".png")
    (folder / "list.xml").write_text(viewer_xml())


def viewer_zip(folder: Path) -> None:
    views = scene()
    with zipfile.ZipFile(folder / "field.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("list.xml", viewer_xml())
        for n in range(9):
            archive.writestr(f"v{n}.png", png(views[n // 3, n % 3]))


def npz_other(folder: Path) -> None:
    np.savez_compressed(folder / "f.npz", lf=scene(kind=np.uint16))


def h5(folder: Path) -> None:
    with h5py.File(folder / "lf.h5", "w") as file:
        file.create_dataset("LF", data=scene(), compression="gzip", chunks=(1, 1, 24, 32, 3))
        file.create_dataset("GT_DEPTH", data=np.full((3, 3, 24, 32), 5, np.float32), compression="gzip")
        for name, value in {"dH": 0.1, "dV": 0.1, "focalLength": 100.0, "shift": 0.5, "scene": "t"}.items():
            file.attrs[name] = value


def vox(folder: Path) -> None:
    with h5py.File(folder / "f.vox", "w") as file:
        file.attrs["description"] = "VoxelDataFormat"
        image = file.create_dataset("/data/image", data=scene(kind=np.float32), compression="gzip")
        image.attrs["mode"], image.attrs["axes"] = "light-field", "v:u:t:s:c"
        camera = file.create_group("/instrument/camera")
        camera.attrs["model"] = "t"

        def put(name: str, value: Any, axes: str | None = None) -> None:
            data = camera.create_dataset(name, data=value)
            data.attrs["units"] = "mm"
            if axes:
                data.attrs["axes"] = axes

        put("main_lens/pixel_size", [1.0, 1.0], "v:u")
        put("micro_lens/physical_size", [0.02, 0.02], "t:s")
        put("main_lens/f1", 50.0)
        put("micro_lens/f2", 0.1)
        put("micro_lenses_array/position", [0.0, 0.0, 52.0], "x:y:z")
        put("sensor/position", [0.0, 0.0, 52.1], "x:y:z")


def lytro_bytes(contents: bytes, blobs: list[bytes]) -> bytes:
    """A container: the table of contents and its blobs, each under its own SHA-1."""

    def section(magic: bytes, data: bytes) -> bytes:
        name = b"sha1-" + hashlib.sha1(data).hexdigest().encode()
        body = magic + bytes(4) + struct.pack(">I", len(data)) + name + bytes(35) + data
        return body + bytes(-len(data) % 16)

    file = bytes.fromhex("894C46500D0A1A0A") + struct.pack(">II", 1, 0)
    file += section(bytes.fromhex("894C464D0D0A1A0A"), contents)
    return file + b"".join(section(bytes.fromhex("894C46430D0A1A0A"), blob) for blob in blobs)


LYTRO_PRIVATE = b'{"camera": {"serialNumber": "A1"}}'
LYTRO_META = {
    "image": {
        "width": 16,
        "height": 8,
        "pixelPacking": {"bitsPerPixel": 10, "endianness": "little"},
        "pixelFormat": {
            "black": {"r": 64, "gr": 64, "gb": 64, "b": 64},
            "white": {"r": 1023, "gr": 1023, "gb": 1023, "b": 1023},
        },
        "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": "gr"},
        "color": {"ccmRgbToSrgbArray": [2.0, -0.5, -0.5, -0.5, 2.0, -0.5, -0.5, -0.5, 2.0]},
    },
    "devices": {
        "mla": {"lensPitch": 2e-5, "rotation": 0.001, "sensorOffset": {"z": 3.7e-5}},
        "sensor": {"pixelPitch": 1.4e-6},
        "lens": {"focalLength": 0.01, "fNumber": 2.0, "exitPupilOffset": {"z": 0.3}},
    },
    "camera": {"make": "Lytro, Inc.", "model": "ILLUM"},
}


def lytro_parts(meta: Any = None, private: bytes = LYTRO_PRIVATE) -> tuple[bytes, list[bytes]]:
    """The table of contents and the blobs: mosaic, metadata, private metadata."""
    mosaic = bytes(n * 37 % 256 for n in range(16 * 8 * 10 // 8))
    meta = json.dumps(LYTRO_META if meta is None else meta).encode()
    names = ["sha1-" + hashlib.sha1(blob).hexdigest() for blob in (mosaic, meta, private)]
    frame = dict(zip(("imageRef", "metadataRef", "privateMetadataRef"), names, strict=True))
    return json.dumps({"frames": [{"frame": frame}]}).encode(), [mosaic, meta, private]


def lytro(folder: Path) -> None:
    (folder / "a.lfr").write_bytes(lytro_bytes(*lytro_parts()))


def lytro_first(folder: Path) -> None:
    """As the first camera wrote it: 12 bits, the higher ones first, and frames of a picture."""
    mosaic = bytes(n * 37 % 256 for n in range(16 * 8 * 12 // 8))
    meta = json.loads(json.dumps(LYTRO_META))
    meta["image"] |= {"pixelPacking": {"bitsPerPixel": 12, "endianness": "big"}}
    meta["image"] = {"width": 16, "height": 8, "orientation": 1, "rawDetails": meta["image"]}
    meta["camera"] = {"make": "Lytro, Inc.", "model": "F01"}
    blobs = [mosaic, json.dumps(meta).encode(), LYTRO_PRIVATE]
    names = ["sha1-" + hashlib.sha1(blob).hexdigest() for blob in blobs]
    frame = dict(zip(("imageRef", "metadataRef", "privateMetadataRef"), names, strict=True))
    contents = json.dumps({"picture": {"frameArray": [{"frame": frame}]}}).encode()
    (folder / "a.lfp").write_bytes(lytro_bytes(contents, blobs))


def eslf(name: str) -> Maker:
    def make(folder: Path) -> None:
        views = scene()
        tiled = views.transpose(2, 0, 3, 1, 4).reshape(72, 96, 3)
        picture(folder / name, np.ascontiguousarray(tiled))

    return make


def mosaic(folder: Path) -> None:
    tiled = scene().transpose(0, 2, 1, 3, 4).reshape(72, 96, 3)
    picture(folder / "a.png", np.ascontiguousarray(tiled))


def video(name: str) -> Maker:
    def make(folder: Path) -> None:
        views = scene(1, 8, 24, 32)[0]
        with av.open(str(folder / name), "w") as container:
            codec = "mjpeg" if name.endswith(".avi") else "libx264"
            stream = container.add_stream(codec, rate=25)
            stream.height, stream.width = 24, 32
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            for view in views:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(view, format="rgb24")))
            container.mux(stream.encode(None))

    return make


def store(lossy: str | None = None, kind: Any = np.uint8) -> Maker:
    def make(folder: Path) -> None:
        how = {} if lossy is None else {"compression": Lossy(lossy, quality=90)}
        save_store(light_field(kind=kind), folder / "s.zarr", **how)

    return make


def store_with_depth(folder: Path) -> None:
    """A store with maps of disparities."""
    whole = light_field()
    maps = np.linspace(-1, 1, 24 * 32, dtype=np.float32).reshape(24, 32)
    save_store(vcc.LightField(whole.values, whole.frame, disparity=maps), folder / "s.zarr")


def light_field_video(folder: Path) -> None:
    with create_video(folder / "v.zarr", between="held") as frames:
        for n in range(3):
            frames.append(light_field(), n / 24)


def sweep(folder: Path) -> None:
    camera = vcc.Camera([vcc.Lens(0.05, name="main")], vcc.Sensor(0.052, (6, 8), 0.0005))
    vcc.sweep(camera, light_field(), {"sensor.z": "51mm:53mm:3"}, metrics=["sharpness"], output=folder / "s.zarr")


def dataset(folder: Path, kind: Any = "webdataset") -> None:
    sensor = vcc.Sensor(0.052, (6, 8), 0.0005, electronics=vcc.Electronics())
    camera = vcc.Camera([vcc.Lens(0.05, name="main")], sensor)
    make_dataset(folder / "pairs", camera, light_field(), count=3, per_shard=2, kind=kind)


def zarr_dataset(folder: Path) -> None:
    dataset(folder, "zarr")


def camera(ending: str) -> Maker:
    def make(folder: Path) -> None:
        cells = scene(1, 1, channels=None)[0, 0][:8, :8]
        file = folder / f"cells{ending}"
        if ending == ".csv":
            np.savetxt(file, cells / 255, delimiter=",")
        elif ending == ".npy":
            np.save(file, cells / 255)
        else:
            picture(file, cells)
        (folder / "camera.toml").write_text(CAMERA.replace("cells.PATTERN", file.name))
        (folder / "lens.dat").write_text(LENS)

    return make


def moving_camera(folder: Path) -> None:
    camera(".npy")(folder)
    file = folder / "camera.toml"
    file.write_text(file.read_text() + MOVING)


def text(name: str, content: str) -> Maker:
    return lambda folder: (folder / name).write_text(content)


def pfm(folder: Path) -> None:
    data = np.linspace(0, 1, 24 * 32, dtype="<f4").tobytes()
    (folder / "gt_disp_lowres.pfm").write_bytes(b"Pf\n32 24\n-1.0\n" + data)


def inria_truth(folder: Path) -> None:
    for j, i in np.ndindex(2, 2):
        np.save(folder / f"disparity_{j + 1}_{i + 1}.npy", np.full((24, 32), j + i, np.float32))


def centres_mat(folder: Path) -> None:
    places = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), -1).reshape(-1, 2) * 10 + 5
    savemat(folder / "c.mat", {"centres": places}, do_compression=True)


def centres_csv(folder: Path) -> None:
    places = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), -1).reshape(-1, 2) * 10 + 5
    (folder / "c.csv").write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in places))


def pbrt_scene(folder: Path) -> None:
    (folder / "a.pbrt").write_text(PBRT_SCENE)
    (folder / "more.pbrt").write_text('Integrator "path" "integer maxdepth" [5]\n')


def mitsuba_scene(folder: Path) -> None:
    (folder / "a.xml").write_text(MITSUBA_SCENE)
    (folder / "more.xml").write_text('<scene version="3.0.0"><bsdf type="diffuse"/></scene>')
    (folder / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def mesh(folder: Path) -> None:
    (folder / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
    )
    (folder / "a.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd t.png\n")
    picture(folder / "t.png", scene()[0, 0])


def splats(name: str, version: int = 3) -> Maker:
    """Gaussian splats, by the ending of the file."""

    def make(folder: Path) -> None:
        if name == "packed.ply":
            (folder / name).write_bytes(packed_ply())
        elif name.endswith(".ply"):
            write_ply(cloud(20, degree=1), folder / name)
        elif name.endswith(".glb"):
            gltf(folder, name)
        elif name.endswith(".spz"):
            (folder / name).write_bytes(spz(version))
        else:
            (folder / name).write_bytes(
                struct.pack("<6f4B4B", 1, 2, 3, 0.1, 0.2, 0.3, 255, 0, 51, 204, 255, 0, 0, 0) * 5
            )

    return make


POSES = """{"w": 800, "h": 600, "fl_x": 400.5, "frames": [{"file_path": "images/a.jpg", "transform_matrix":
[[0.0, 0.0, -1.0, 1.5], [0.0, 1.0, 0.0, 2.5], [1.0, 0.0, 0.0, 3.5], [0.0, 0.0, 0.0, 1.0]]}]}"""
CAMERAS = """[{"id": 0, "img_name": "a", "width": 800, "height": 600, "fx": 400.5, "fy": 400.5, "position":
[1.5, 2, 3], "rotation": [[0, 0, 1], [0, -1, 0], [1, 0, 0]]}]"""
