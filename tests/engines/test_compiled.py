"""Kernels work if their machine code cannot be cached, or if the cached code is damaged."""

import gc
import importlib.util
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core import event

from vcc.engines import compiled
from vcc.errors import CacheWarning

KERNEL = """
from vcc.engines.compiled import compiled

@compiled()
def doubled(x):
    return x + x
"""

Load = Callable[[], Any]


@pytest.fixture
def loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Load:
    """Loads a kernel from its own file, as a new process does, without caching code in the home folder."""
    monkeypatch.setenv("HOME", "/dev/null")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(compiled, "_said", [])
    file = tmp_path / "kernel.py"
    file.write_text(KERNEL)

    def load() -> Any:
        spec = importlib.util.spec_from_file_location("kernel", file)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.doubled

    return load


def was_read(kernel: Any) -> bool:
    """Whether cached code of the kernel was loaded instead of compiling it."""
    return sum(kernel.stats.cache_hits.values()) > 0


def test_code_is_kept_beside_its_source_and_read_again(loaded: Load, tmp_path: Path) -> None:
    first, second = loaded(), loaded()
    assert first(21) == 42
    assert list((tmp_path / "__pycache__").glob("kernel.doubled*.nbc"))
    assert second(21) == 42
    assert (was_read(first), was_read(second)) == (False, True)


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_is_not_collected_while_code_is_compiled(loaded: Load, enabled: bool) -> None:
    found = []

    class Seen(event.Listener):
        def on_start(self, _: event.Event) -> None:
            found.append(gc.isenabled())

        def on_end(self, _: event.Event) -> None:
            found.append(gc.isenabled())

    was = gc.isenabled()
    try:
        (gc.enable if enabled else gc.disable)()
        with event.install_listener("numba:run_pass", Seen()):
            assert loaded()(21) == 42
        assert gc.isenabled() is enabled
        with pytest.raises(numba.TypingError):
            loaded()({})
        assert gc.isenabled() is enabled
    finally:
        (gc.enable if was else gc.disable)()
    assert found
    assert not any(found)


@pytest.mark.parametrize("changed", ["called", "constants"])
def test_code_is_compiled_again_where_another_file_of_its_package_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    """A change in a file that a kernel imports invalidates its cached code, not only a change in its own file."""
    header = "from vcc.engines.compiled import compiled\n"
    files = {
        "kernel": f"{header}from of_a_test.called import times\n\n"
        "@compiled()\ndef made(x):\n    return times(x)\n",
        "called": f"{header}from of_a_test import (  # in lines\n    constants,\n)\nBY = constants.BY\n\n"
        "@compiled()\ndef times(x):\n    return BY * x\n",
        "constants": "BY = 3\n",
        "beside": "BY = 5\n",
    }
    instead = {"called": files["called"].replace("BY * x", "BY * x + 10"), "constants": "BY = 4\n"}
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.syspath_prepend(tmp_path)
    folder = tmp_path / "of_a_test"
    folder.mkdir()
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text)

    def load() -> Any:
        for name in [name for name in sys.modules if name.partition(".")[0] == "of_a_test"]:
            del sys.modules[name]
        importlib.invalidate_caches()
        return importlib.import_module("of_a_test.kernel").made

    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python's own cache has timestamps in seconds
    assert load()(2) == 6
    (folder / "beside.py").write_text("BY = 6\n")  # not imported
    again = load()
    assert again(2) == 6
    assert was_read(again)
    (folder / f"{changed}.py").write_text(instead[changed])
    assert load()(2) == (16 if changed == "called" else 8)
    for name in [name for name in sys.modules if name.partition(".")[0] == "of_a_test"]:
        del sys.modules[name]


def test_stamps_cost_little() -> None:
    """Stamping all kernels of the package at import takes a few milliseconds."""
    from vcc.engines import ray_loops

    compiled._read.cache_clear()
    start = time.process_time()
    compiled._sources(ray_loops.__name__, ray_loops.__file__)
    assert time.process_time() - start < 0.05  # it takes 0.004 s


def test_where_no_code_can_be_kept_it_is_compiled_and_that_is_said_once(loaded: Load, tmp_path: Path) -> None:
    (tmp_path / "__pycache__").write_text("no folder can be made here, by root neither")
    with pytest.warns(CacheWarning, match="compiles again.*NUMBA_CACHE_DIR") as said:
        assert (loaded()(21), loaded()(1.5)) == (42, 3)
    assert len(said) == 1


def test_a_cache_that_came_along_and_cannot_be_written_to_is_read(
    loaded: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    loaded()(21)
    monkeypatch.setattr(tempfile, "TemporaryFile", refused)  # Numba tests with it whether a folder is writable
    kernel = loaded()
    assert kernel(21) == 42
    assert was_read(kernel)


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("length", [0, 40])
def test_damaged_code_is_compiled_again_and_kept(loaded: Load, tmp_path: Path, ending: str, length: int) -> None:
    loaded()(21)
    (kept,) = (tmp_path / "__pycache__").glob(f"kernel.doubled*.{ending}")
    kept.write_bytes(kept.read_bytes()[:length])
    second, third = loaded(), loaded()
    assert second(21) == 42
    assert third(21) == 42
    assert (was_read(second), was_read(third)) == (False, True)


def test_code_that_another_process_kept_under_the_same_name_is_not_taken(loaded: Load, tmp_path: Path) -> None:
    of_floats = loaded()
    of_floats(1.5)
    (kept,) = (tmp_path / "__pycache__").glob("*.nbc")
    other = kept.read_bytes()
    for file in (tmp_path / "__pycache__").glob("kernel.doubled*"):
        file.unlink()
    loaded()(21)
    kept.write_bytes(other)  # as if two processes cached code of a function at the same time
    kernel = loaded()
    assert kernel(21) == 42
    assert not was_read(kernel)


def test_a_disk_that_fills_up_while_code_is_kept_is_no_failure(
    loaded: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    kernel = loaded()
    monkeypatch.setattr(type(kernel._cache._cache_file), "_save_data", full)
    with pytest.warns(CacheWarning, match="No space left"):
        assert kernel(21) == 42
    monkeypatch.undo()
    with warnings.catch_warnings():  # code that the index lists, but that does not exist, is compiled
        warnings.simplefilter("error")
        assert loaded()(21) == 42


def test_processes_take_turns_to_keep_code(loaded: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process holds the lock, and releases it while this one waits."""
    fcntl = pytest.importorskip("fcntl")
    folder, waited = tmp_path / "__pycache__", []
    folder.mkdir()
    with (folder / compiled.TURN).open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)

        def wait(seconds: float) -> None:
            assert not list(folder.glob("*.nbi"))
            waited.append(seconds)
            fcntl.flock(other, fcntl.LOCK_UN)

        monkeypatch.setattr(compiled.time, "sleep", wait)
        assert loaded()(21) == 42
        assert len(waited) == 1
        assert list(folder.glob("kernel.doubled*.nbc"))


def test_nobody_waits_for_ever_for_a_turn(loaded: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl")
    monkeypatch.setattr(compiled, "PATIENCE", 0.0)
    (tmp_path / "__pycache__").mkdir()
    with (tmp_path / "__pycache__" / compiled.TURN).open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        assert loaded()(21) == 42
