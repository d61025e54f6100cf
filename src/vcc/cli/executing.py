"""The executor of the blocks of a light field, as an option of the command line."""

import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.cli.options import MAKING
from vcc.plan.how import cores
from vcc.store import is_store

DASK = "dask://"
CONNECTING = 10.0
"""Seconds to wait for a scheduler."""


Who = Annotated[str | None, Parameter(metavar="EXECUTOR")]


@Parameter(name="*", group=MAKING)
@dataclass(frozen=True, kw_only=True)
class Executing:
    """The executor of the blocks of a light field.

    Args:
        executor: For a light field in a store: what reads and processes its blocks. `processes` or `threads`,
            one per core of this machine, or a Dask cluster by its scheduler, "dask://host:8786". Each task
            uses one thread and a memory limit of its own. Default: one block after the other, each on all
            cores.
    """

    executor: Who = None

    def check_name(self) -> None:
        """Check the name of the executor.

        Raises:
            InputError: there is no such executor.
        """
        if self.executor not in (None, "processes", "threads") and not self.executor.startswith(DASK):
            raise InputError(f'--executor is processes, threads or "{DASK}host:8786", not {self.executor!r}')

    def check(self, light_field: Path) -> None:
        """Check the options before the light field is read.

        Raises:
            InputError: no such executor, or a light field that is not in a store.
        """
        self.check_name()
        if self.executor is not None and not is_store(light_field):
            raise InputError(
                f"--executor requires a light field in a store, and {light_field} is not a store: convert it with "
                f"vcc convert {light_field} scene.zarr, or leave --executor out"
            )

    @contextmanager
    def opened(self) -> Iterator[Any]:
        """The executor, open within the context; None if none is selected.

        Raises:
            InputError: Dask is not installed, or its scheduler does not answer.
        """
        if self.executor is None:
            yield None
        else:
            kinds = {"threads": _threads, "processes": _processes}
            opened = kinds.get(self.executor) or partial(_client, self.executor.removeprefix(DASK))
            with opened() as executor:
                yield executor


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
