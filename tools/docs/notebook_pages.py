"""The notebooks of examples/ as pages of docs/notebooks, with what their cells show.

Notebooks are stored without outputs: these belong to a run, and would make every change of a word a change of a
megabyte. Whoever opens one runs it in a few seconds; whoever only wants to read finds it here with its pictures.

    python tools/docs/notebook_pages.py
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).parents[2] / "docs"
EXAMPLES = HERE.parent / "examples"
NOTEBOOKS = ("first_camera", "plenoptic", "learn_a_mask")


@dataclass
class Ran:
    """A cell, and what it shows.

    Args:
        kind: "markdown" or "code".
        source: as it stands.
        printed: by it.
        value: what it ends with, or what is shown of that; None for nothing.
    """

    kind: str
    source: str
    printed: str = ""
    value: Any = field(default=None, repr=False)


def cells(name: str) -> list[tuple[str, str]]:
    """(kind, source) of each cell of a notebook."""
    book = json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))
    return [(cell["cell_type"], "".join(cell["source"])) for cell in book["cells"]]


def run(
    name: str, names: dict[str, Any] | None = None, show: Callable[[Any], Any] = lambda value: value
) -> Iterator[Ran]:
    """A notebook's cells as they are run one after the other, in its folder, as a kernel would.

    Args:
        name: of the notebook.
        names: filled with what its cells define.
        show: what is made of a cell's last value, there and then.
    """
    names = {} if names is None else names
    for number, (kind, source) in enumerate(cells(name)):
        if kind != "code":
            yield Ran(kind, source)
            continue
        tree = ast.parse(source)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        where = f"{name}.ipynb, cell {number}"
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.chdir(EXAMPLES):
            exec(compile(tree, where, "exec"), names)
            value = eval(compile(ast.Expression(last.value), where, "eval"), names) if last else None
            value = None if value is None else show(value)
        yield Ran(kind, source, printed.getvalue(), value)


def main() -> None:
    """Write all pages."""
    for name in NOTEBOOKS:
        folder = HERE / "images" / "notebooks" / name
        folder.mkdir(parents=True, exist_ok=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            text = page(name, folder)
        (HERE / "notebooks" / f"{name}.md").write_text(text, encoding="utf-8")
        print(name, file=sys.stderr)


def page(name: str, folder: Path) -> str:
    """A notebook as Markdown; its pictures are written to a folder."""
    parts = [f"<!-- python tools/docs/notebook_pages.py writes this page of examples/{name}.ipynb -->"]
    for number, ran in enumerate(run(name, show=bundle)):
        if ran.kind != "code":
            parts.append(ran.source.replace(".ipynb)", ".md)"))
            continue
        parts.append(f"```python\n{ran.source}\n```")
        if ran.printed:
            parts.append(f"```text\n{ran.printed.rstrip()}\n```")
        if ran.value is not None:
            parts += shown(ran.value, folder / f"{number}.png")
    return "\n\n".join(parts) + "\n"


def bundle(value: Any) -> dict[str, str]:
    """What a notebook is given of a value, by MIME type."""
    made = getattr(value, "_repr_mimebundle_", None)
    return {"text/plain": repr(value)} if made is None else made()


def shown(made: dict[str, str], path: Path) -> list[str]:
    """What a cell shows, as Markdown: HTML with its pictures in files, or words."""
    if "text/html" not in made:
        return [f"```text\n{made['text/plain']}\n```"]

    def moved(found: re.Match[str]) -> str:
        file = path.with_stem(f"{path.stem}-{len(kept)}")
        file.write_bytes(base64.b64decode(found[1]))
        kept.append(file)
        return f'src="../{file.relative_to(HERE).as_posix()}"'

    kept: list[Path] = []
    text = re.sub(r'src="data:image/png;base64,([^"]+)"', moved, made["text/html"])
    return [f'<div class="cell">{text}</div>']


if __name__ == "__main__":
    os.environ.setdefault("MPLBACKEND", "Agg")
    main()
