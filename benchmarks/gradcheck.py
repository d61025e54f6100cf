"""`torch.autograd.gradcheck` of every parameter that docs/learning.md calls exact: a table, and what fails.

    pip install ".[torch]"
    python benchmarks/gradcheck.py                  # some minutes; exit code 1 where one fails
    python benchmarks/gradcheck.py --kind axicon    # one element
    python benchmarks/gradcheck.py --between auto   # an hour: with views in between, a thousand taps instead of 16

Cameras are those of the page's table (tools/docs/learning_table.py), before a light field of random samples;
pictures by the reference, in double precision, by footprints and by rays. Each parameter is checked by itself:
all its numbers, derivatives to 1e-3. Steps are 1e-5 of its scale by footprints. A ray looks samples up linearly,
which has a kink at each sample: of some thousand rays that a step moves by ten thousandths of a sample, one or so
crosses a kink. Steps by rays are 1e-8, which meet none but by chance; what double precision rounds is then still
a thousandth of the tolerance.
"""

from __future__ import annotations

import argparse
import runpy
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch.func import functional_call

import vcc
from vcc.learn.parameters import names
from vcc.learn.verdicts import verdict
from vcc.torch import CameraModule
from vcc.units import mm

TABLE = runpy.run_path(str(Path(__file__).resolve().parents[1] / "tools" / "docs" / "learning_table.py"))
ELEMENTS = TABLE["ELEMENTS"]
STEP = {"footprints": 1e-5, "rays": 1e-8}
VALUES = np.random.default_rng(0).random((4, 4, 10, 10))
FIELD = vcc.LightField.from_views(VALUES, 2.25 * mm, 2.5e-3, 1.0, (-0.3, 0.3), sample="point")


def passes(camera: vcc.Camera, name: str, how: vcc.How) -> bool:
    """Whether the derivative to a parameter is that of the picture."""
    model = CameraModule(camera, FIELD, [name], how)
    ((key, kept),) = model.named_parameters()
    picture = model().detach()
    weights = torch.randn(picture.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    weights /= picture.abs().mean()

    def weighted(moved: torch.Tensor) -> torch.Tensor:
        return (functional_call(model, {key: moved}, ()) * weights).sum()

    given = kept.detach().clone().requires_grad_()
    return torch.autograd.gradcheck(
        weighted, (given,), eps=STEP[how.method], atol=1e-5, rtol=1e-3, raise_exception=False
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=list(ELEMENTS))
    parser.add_argument("--between", choices=["none", "auto"], default="none", help="see between_views of capture")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| element | by | exact | pass | which do not |\n|---|---|---|---|---|")
    failed = False
    for kind in [given.kind] if given.kind else ELEMENTS:
        camera = TABLE["camera_of"](ELEMENTS[kind])
        # Not at the end of what a fill factor may be, beside which there are no differences.
        camera = vcc.Camera(camera.elements, replace(camera.sensor, fill_factor=0.8))
        for method in ("footprints", "rays"):
            by = {"samples": 16} if method == "rays" else {"between_views": given.between}
            how = vcc.How(method=method, engine="reference", **by)
            exact = [name for name in names(camera) if verdict(camera, FIELD.grid, name, how).kind == "exact"]
            if method == "footprints" and not exact:
                continue
            own = [name for name in exact if kind == "lens" or name.startswith(ELEMENTS[kind].name)]
            wrong = [name for name in own if not passes(camera, name, how)]
            failed |= bool(wrong)
            print(f"| {kind} | {method} | {len(own)} | {len(own) - len(wrong)} | {', '.join(wrong)} |", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
