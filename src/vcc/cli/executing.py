"""The executor of the blocks of a light field, as an option of the command line."""

import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.cli.options import MAKING, quantity
from vcc.plan.how import cores
from vcc.store import is_store

DASK = "dask://"
CONNECTING = 10.0
"""Seconds to wait for a scheduler."""


def _name(text: str, option: str) -> str | None:
    """The name of an executor, None for "none".

    Raises:
        InputError: there is no such executor.
    """
    if text not in ("none", "processes", "threads") and not text.startswith(DASK):
        raise InputError(f'{option} is processes, threads or "{DASK}host:8786", not {text!r}')
    return None if text == "none" else text


Who = Annotated[str | None, quantity("EXECUTOR", _name), Parameter(group=MAKING)]
OfBlocks = Annotated[
    Who,
    Parameter(
        help="For a light field in a store: what reads and processes its blocks. `processes` or `threads`, one "
        'per core of this machine, or a Dask cluster by its scheduler, "dask://host:8786". Each task uses one '
        "thread and a memory limit of its own. Default: one block after the other, each on all cores."
    ),
]


def check_blocks(executor: str | None, light_field: Path) -> None:
    """Check, before a light field is read, that an executor can read it in blocks.

    Raises:
        InputError: the light field is not in a store.
    """
    if executor is not None and not is_store(light_field):
        raise InputError(
            f"--executor requires a light field in a store, and {light_field} is not a store: convert it with "
            f"vcc convert {light_field} scene.zarr, or leave --executor out"
        )


@contextmanager
def opened(executor: str | None) -> Iterator[Any]:
    """The executor of this name, open within the context; None if none is selected.

    Raises:
        InputError: no scheduler answers at the address.
    """
    if executor is None:
        yield None
        return
    kinds = {"threads": _threads, "processes": _processes}
    with (kinds.get(executor) or partial(_client, executor.removeprefix(DASK)))() as found:
        yield found


@contextmanager
def _threads() -> Iterator[Any]:
    pool = ThreadPoolExecutor(cores())
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _processes() -> Iterator[Any]:
    pool = ProcessPoolExecutor(cores(), multiprocessing.get_context("spawn"), _leave_interrupts)
    try:
        yield pool
    except BaseException:
        for process in multiprocessing.active_children():  # their work is no longer needed
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _leave_interrupts() -> None:
    """Ignore Ctrl-C in workers: it reaches all processes of a terminal, and the main process ends the workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _client(address: str) -> Iterator[Any]:
    with checks.package("--executor dask://…", "distributed", "cluster"):
        from distributed import Client
    try:
        client = Client(f"tcp://{address}", timeout=CONNECTING, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address} ({error}): start one with dask scheduler, and workers with "
            f"dask worker {address}"
        ) from error
    with client:
        yield client
