"""Run cameras of the gallery and write their pages: python tools/docs/gallery_pages.py [NAME…].

Without a name, all of them; each takes up to two minutes. Writes docs/gallery/NAME.md with the pictures in
docs/images/gallery/NAME, and the table of docs/gallery/index.md, which reads what the pages hold. Cameras of
`RENDERED` are run on a rendered light field, too (--rendered: only that); pictures of it end their pages.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import re
from dataclasses import replace
from pathlib import Path

import vcc
from vcc.gallery import ENTRIES, Entry, Result, entry, write_entry_markdown
from vcc.gallery.page import pictures_markdown, plain

HERE = Path(__file__).parents[2] / "docs"
PAGES = HERE / "gallery"
PICTURES = HERE / "images" / "gallery"
MODULES = HERE.parent / "src" / "vcc" / "gallery"
FRAME = {"entry", "listing", "page"}
"""Modules that hold no camera: a change of theirs does not change what was measured."""
THUMBNAIL = 200
"""Pixels that a thumbnail is wide and high."""
THUMBNAILS = {
    "heterodyne": ("views", (0, 0, 1 / 3, 1 / 3)),
    "coded-aperture-refocusing": ("scene-coded-recorded", (0, 0, 1, 1)),
    "coded-aperture-depth": ("kernels", (0.03, 0.055, 0.21, 0.335)),
    "good-apertures": ("patterns", (0.604, 0.092, 0.799, 0.49)),
    "learned-aperture": ("codes", (0.029, 0.085, 0.138, 0.297)),
    "light-field-rendering": ("from-before", (0, 0, 1, 1)),
    "plenoptic": ("raw", (0.52, 0.05, 0.98, 0.95)),
    "angle-sensitive-pixels": ("recording", (0.52, 0.05, 0.98, 0.95)),
    "compressive-light-field": ("recordings", (0.68, 0.1, 0.98, 0.95)),
    "dual-pixel": ("difference", (0, 0, 1, 1)),
    "wavefront-coding": ("scene-coded", (0, 0.2, 0.5, 0.7)),
    "diffuser-depth-of-field": ("scene-coded", (0, 0.2, 0.5, 0.7)),
    "diffusercam": ("recordings", (0.08, 0.2, 0.27, 0.85)),
    "focal-sweep": ("scene-restored", (0, 0.2, 0.5, 0.7)),
    "coded-aperture-real-lens": ("psf", (0.52, 0.03, 0.76, 0.265)),
    "real-lens": ("points", (0.628, 0.036, 0.805, 0.262)),
    "coded-exposure": ("target", (0.68, 0.53, 1, 0.98)),
    "tensor-display": ("layers", (0.36, 0.05, 0.66, 0.48)),
    "cassi": ("scene", (0.338, 0.033, 0.661, 0.492)),
}
"""Where the first picture has words on it: which one to take, and what part of it (left, top, right, bottom)."""
DESK = HERE / "data" / "desk.zarr"
RENDERED = {
    "plenoptic": ("raw", "views", "refocused"),
    "angle-sensitive-pixels": ("recording", "views", "refocused"),
    "coded-aperture-refocusing": ("scene-open-recorded", "scene-coded-recorded", "scene-open", "scene-coded"),
    "diffuser-depth-of-field": ("scene-plain", "scene-coded", "scene-restored"),
}
"""Which pictures of a run on the rendered desk are shown."""
_RENDERED_PART = re.compile(r"## On a rendered scene\n.*?(?=^---$)", re.M | re.S)
_MARK = re.compile(r"<!-- run of ([\w-]+), source ([0-9a-f]+), claims reached (\d+) of (\d+) -->")
_TABLE = re.compile(r"(<!-- table of the cameras -->\n).*?(<!-- end of the table -->)", re.S)


def main() -> None:
    """Run those named and write their pages, then the table."""
    parser = argparse.ArgumentParser(description="Run cameras of the gallery and write their pages.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(ENTRIES))
    parser.add_argument("--rendered", action="store_true", help="only what is shown of the rendered desk")
    options = parser.parse_args()
    for name in options.names or ENTRIES:
        print(name)
        made = entry(name)
        if not options.rendered:
            write_page(made, made.run())
        if name in RENDERED:
            write_rendered(made, made.run(DESK))
    write_table()


def fingerprint(name: str) -> str:
    """A short hash of an entry's prose and code, and of what it imports of the gallery, docstrings left out."""
    prose = sorted((MODULES / "prose").glob(f"{name}*"))
    sources = {path.name: path.read_text(encoding="utf-8") for path in prose}
    waiting = [name.replace("-", "_")]
    while waiting:
        module = waiting.pop()
        sources[module] = (MODULES / f"{module}.py").read_text(encoding="utf-8")
        tree = ast.parse(sources[module])
        sources[module] = ast.unparse(without_docstrings(tree))
        for imported in ast.walk(tree):
            if isinstance(imported, ast.Constant) and str(imported.value).startswith("vcc.gallery."):
                by_name = str(imported.value).removeprefix("vcc.gallery.")
                waiting += [by_name] if by_name not in sources else []
            elif isinstance(imported, ast.ImportFrom) and (imported.module or "").startswith("vcc.gallery"):
                inside = imported.module.removeprefix("vcc.gallery").lstrip(".")
                others = [inside] if inside else [alias.name for alias in imported.names]
                waiting += [each for each in others if (MODULES / f"{each}.py").exists() and each not in sources]
        waiting = [each for each in waiting if each not in FRAME]
    text = "".join("".join(sources[module].split()) for module in sorted(sources))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def without_docstrings(tree: ast.Module) -> ast.Module:
    """A module without strings that stand as statements."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [one for one in body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
            node.body = kept or [ast.Pass()]  # type: ignore[attr-defined]
    return tree


def write_page(made: Entry, result: Result) -> None:
    """Write the page of a run and its pictures."""
    claims = [number.reached for number in result.numbers if number.reached is not None]
    reached = f"claims reached {sum(claims)} of {len(claims)}"
    module = made.name.replace("-", "_")
    note = (
        f"---\n\nMade by `python tools/docs/gallery_pages.py {made.name}` with vcc {vcc.__version__} on the "
        f"built-in scene. `vcc gallery {made.name}` writes the page as HTML, also for your own light field. The "
        f"camera is [one file](../../src/vcc/gallery/{module}.py).\n\n"
        f"<!-- run of {made.name}, source {fingerprint(made.name)}, {reached} -->"
    )
    folder = PICTURES / made.name
    write_entry_markdown(made, result, PAGES, pictures=folder, note=note)
    write_thumbnail(made.name, result.pictures[0][0].name)


def write_rendered(made: Entry, result: Result) -> None:
    """Put pictures of a run on the rendered desk at the end of a page, in place of those that are there."""
    chosen = [
        tuple(
            replace(picture, name=f"desk-{picture.name}") for picture in row if picture.name in RENDERED[made.name]
        )
        for row in result.pictures
    ]
    command = f"vcc gallery {made.name} --light-field docs/data/desk.zarr"
    words = (
        "## On a rendered scene\n\nThe same camera before [a desk](../synthesis.md) that Mitsuba rendered, 9×9 "
        f"views; what is far out of focus shows their grid. `{command}` writes the page of that run, with its "
        "numbers.\n\n"
    )
    part = words + pictures_markdown([row for row in chosen if row], PAGES, PICTURES / made.name) + "\n\n"
    page = PAGES / f"{made.name}.md"
    text = _RENDERED_PART.sub("", page.read_text(encoding="utf-8"))
    before, line, note = text.rpartition("---\n\nMade by")
    page.write_text(before + part + line + note, encoding="utf-8")


def write_thumbnail(name: str, first: str) -> None:
    """Write a camera's small square picture: its first one, or the part of another that `THUMBNAILS` names."""
    from PIL import Image, ImageOps

    picture, (left, top, right, bottom) = THUMBNAILS.get(name, (first, (0, 0, 1, 1)))
    found = next(path for kind in ("png", "jpg", "webp") for path in (PICTURES / name).glob(f"{picture}.{kind}"))
    with Image.open(found) as whole:
        width, height = whole.size
        part = whole.convert("RGB").crop(
            (round(left * width), round(top * height), round(right * width), round(bottom * height))
        )
    small = ImageOps.fit(part, (THUMBNAIL, THUMBNAIL), Image.Resampling.LANCZOS)
    small.save(PICTURES / name / "thumbnail.webp", quality=88, method=6)


def write_table() -> None:
    """Write the table of the gallery's front page from the pages that there are."""
    lines = ["| | camera | published by | claims reached |", "|---|---|---|---|"]
    for name in ENTRIES:
        page = PAGES / f"{name}.md"
        if not page.exists():
            continue
        made, mark = entry(name), _MARK.search(page.read_text(encoding="utf-8"))
        if mark is None:
            raise SystemExit(f"{page} was not written by this script: run it with the name {name}")
        lines.append(
            f"| [![](../images/gallery/{name}/thumbnail.webp)]({name}.md) | [{plain(made.title)}]({name}.md) "
            f"| {plain(made.citation)} | {mark[3]} of {mark[4]} |"
        )
    index = PAGES / "index.md"
    text = index.read_text(encoding="utf-8")
    index.write_text(_TABLE.sub(lambda m: m[1] + "\n" + "\n".join(lines) + "\n\n" + m[2], text), encoding="utf-8")


if __name__ == "__main__":
    main()
