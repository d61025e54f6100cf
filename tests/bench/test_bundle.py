"""The module of the bench's front end: small, self-contained, and what its sources make."""

import re
import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FRONT = ROOT / "bench" / "front"
BUNDLE = ROOT / "src" / "vcc" / "bench" / "static" / "bench.js"
LARGEST = 200_000
"""Bytes: what a page may have to load before anything is seen."""


def test_module_is_small_and_needs_nothing_from_elsewhere():
    code = BUNDLE.read_text(encoding="utf-8")
    assert BUNDLE.stat().st_size <= LARGEST
    assert not re.search(r"\beval\(|\bnew Function\b|\bimport\(", code)
    assert not re.search(r"\bimport\s*[{*\"']|\bimport\s+\w|\}\s*from\s*[\"']", code)
    addresses = set(re.findall(r"https?://[^\s\"'`)<]+", code))
    assert {address for address in addresses if not address.startswith("http://www.w3.org/")} == set()


def test_module_is_what_its_sources_make(tmp_path):
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node is not installed; .ci/run has it")
    if not (FRONT / "node_modules" / "esbuild").is_dir():
        pytest.skip("esbuild is not installed: run npm ci in bench/front, as .ci/run does")
    subprocess.run([node, "build.mjs", "--to", str(tmp_path / "bench.js")], cwd=FRONT, check=True, timeout=60)
    made = (tmp_path / "bench.js").read_bytes()
    assert made == BUNDLE.read_bytes(), "the sources have changed: run npm run build in bench/front"


def test_messages_of_the_front_end_are_those_of_python():
    made = runpy.run_path(str(ROOT / "tools" / "bench" / "protocol.py"))["protocol"]()
    written = (FRONT / "src" / "protocol.ts").read_text(encoding="utf-8")
    assert made == written, "vcc/bench/messages.py has changed: run tools/bench/protocol.py, and npm run build"
