"""The GPU engine: its kernels in the simulator, without a GPU, and the errors on a machine without one."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vcc
from tests.engines.test_agreement import CAMERAS, field, samples

HERE = Path(__file__).parent


def test_kernels_in_the_simulator():
    environment = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", HERE / "cuda_in_simulator.py"],
        env=environment, capture_output=True, text=True, check=False, cwd=HERE.parents[1],
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


def test_without_a_gpu_it_says_what_runs_instead():
    from numba import cuda

    if cuda.is_available():
        pytest.skip("there is a GPU")
    with pytest.raises(vcc.InputError, match=r"needs an NVIDIA GPU.*engine='numba'"):
        CAMERAS["in focus"].capture(field(samples()), engine="cuda")
    with pytest.raises(vcc.InputError, match="needs an NVIDIA GPU"):
        field(samples()).on_gpu()


def test_without_the_extra_it_says_what_to_install(monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "numba_cuda" else found(name))
    with pytest.raises(
        vcc.InputError, match=r"needs numba-cuda.*pip install .virtual-computational-camera\[gpu\]"
    ):
        CAMERAS["in focus"].capture(field(np.asarray(samples())), engine="cuda")


def test_kernels_compile_for_a_gpu_that_is_not_here():
    done = subprocess.run(
        [sys.executable, HERE / "cuda_to_ptx.py"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE.parents[1]), *sys.path])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode == 77:
        pytest.skip("NVIDIA's compiler is not installed: pip install 'virtual-computational-camera[gpu]'")
    assert done.returncode == 0, done.stderr[-4000:]
    assert len(done.stdout.splitlines()) > 20  # kernels
