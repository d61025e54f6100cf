"""The zoo: computational cameras compared on the same scenes, exposures, noise and decoders, with their controls.

::

    vcc.zoo.run("edof", "zoo.zarr")
    print(vcc.zoo.Report.of("zoo.zarr", "edof").markdown())
"""

from __future__ import annotations

from vcc.zoo.decoders import Decoder, Recorded
from vcc.zoo.report import Report
from vcc.zoo.running import run
from vcc.zoo.scenes import Scene, scene
from vcc.zoo.task import Task
from vcc.zoo.tasks import TASKS

__all__ = ["TASKS", "Decoder", "Recorded", "Report", "Scene", "Task", "run", "scene"]
