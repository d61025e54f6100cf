"""Sweeps: images of many cameras of one light field, along labelled axes, and a table of them.

::

    swept = vcc.sweep(camera, light_field, {"sensor.z": "50mm:54mm:40", "code.pattern": "mura, circle"})
    swept[3, 0].save("picture.png")
    swept.table.save("table.csv")
"""

from __future__ import annotations

from vcc.sweeps.design import Design, grid, listed, random, sobol
from vcc.sweeps.keeping import open_sweep, save_sweep
from vcc.sweeps.metrics import PSNR, DeblurringError, sharpness
from vcc.sweeps.result import Sweep
from vcc.sweeps.sheet import contact_sheet
from vcc.sweeps.sweeping import sweep
from vcc.sweeps.table import Table

__all__ = [
    "PSNR",
    "DeblurringError",
    "Design",
    "Sweep",
    "Table",
    "contact_sheet",
    "grid",
    "listed",
    "open_sweep",
    "random",
    "save_sweep",
    "sharpness",
    "sobol",
    "sweep",
]
