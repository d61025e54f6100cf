"""Figures belong to pyplot exactly where someone uses pyplot, so that notebooks show them."""

import subprocess
import sys

import pytest

PROGRAM = """
import matplotlib
matplotlib.use("Agg")
{import_pyplot}
import sys, vcc
axes = vcc.Camera([vcc.Lens(0.05)], vcc.Sensor(0.05, (4, 4), 1e-3)).plot()
pyplot = sys.modules.get("matplotlib.pyplot")
print(pyplot is not None and axes.figure.number in pyplot.get_fignums())
"""


@pytest.mark.parametrize(("import_pyplot", "managed"), [("", "False"), ("import matplotlib.pyplot", "True")])
def test_a_figure_is_pyplots_where_pyplot_is_used(import_pyplot, managed):
    program = PROGRAM.format(import_pyplot=import_pyplot)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [managed]
