"""Figures belong to pyplot exactly where someone uses pyplot, so that notebooks show them."""

import subprocess
import sys

PROGRAM = """
import matplotlib
matplotlib.use("Agg")
{import_pyplot}
import sys, vcc
axes = vcc.Camera([vcc.Lens(0.05)], vcc.Sensor(0.05, (4, 4), 1e-3)).plot()
pyplot = sys.modules.get("matplotlib.pyplot")
print(pyplot is not None and axes.figure.number in pyplot.get_fignums())
"""


def test_a_figure_is_pyplots_where_pyplot_is_used():
    """In one process: before anything loads it, and after."""
    program = PROGRAM.format(import_pyplot="") + PROGRAM.format(import_pyplot="import matplotlib.pyplot")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
