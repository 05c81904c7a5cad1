"""Workers of a Dask cluster that somebody else started; extra ``cluster``."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from pathlib import Path
from typing import Any

from lfstereo import __version__
from lfstereo.batch.crew import PairWork, Step
from lfstereo.batch.jobs import WORK_FOLDER
from lfstereo.batch.notes import Note
from lfstereo.errors import ConfigError, InputError, MissingExtraError

GPU, CPU = "GPU", "CPU"
"""Resources by which workers are told apart: ``dask worker --resources GPU=1`` for the network, ``CPU=1`` for the rest.

Where a GPU is declared but no CPU, workers with a GPU may be given the other steps too.
"""
_CONNECT_S = 20
_FIRST_WORKER_S = 60
_CLOSE_S = 5
_FETCH_S = 60
_WAITING_PER_WORKER = 1
"""Jobs beyond the running ones that wait at the scheduler, so that no worker is idle for a round trip."""


class ClusterCrew:
    """The workers of a running Dask scheduler.

    Raises
    ------
    MissingExtraError
        If ``distributed`` is not installed.
    ConfigError
        If there is no scheduler at the address, or it has no workers.
    InputError
        If a worker does not see the output folder, or has another version of lfstereo.
    """

    def __init__(self, address: str, output: Path, work: PairWork) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise MissingExtraError(
                "--scheduler needs the package distributed; pip install 'lfstereo[cluster]'"
            ) from error
        try:
            self._client = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error).splitlines()[0]
            raise ConfigError(
                f"scheduler = {address}: found no Dask scheduler ({reason}); start one with 'dask scheduler'"
            ) from error
        try:
            self._check(address, output)
        except BaseException as error:
            self.close(True)
            if isinstance(error, OSError):
                raise ConfigError(
                    f"scheduler = {address}: lost while its workers were looked at ({error}); start again"
                ) from error
            raise
        workers, gpus, plain = self._count(None), self._count(GPU), self._count(CPU)
        if gpus and gpus < workers:
            apart = CPU if plain else None
            self.steps: tuple[Step, ...] = (
                Step(work.focus, self._executor(apart), self._capacity(apart)),
                Step(work.match, self._executor(GPU), self._capacity(GPU)),
            )
        else:
            self.steps = (Step(work.whole, self._executor(None), self._capacity(None)),)
        self.description = (
            f"{workers} workers ({gpus} with {GPU}) of {address}; dashboard {self._client.dashboard_link}"
        )

    def stop(self, _: Note, /) -> None:
        """Do nothing: a worker ends itself, and the scheduler drops one that does not answer (``worker-ttl``)."""

    def lost_a_worker(self, error: Exception, /) -> bool:
        """Return whether its worker died, or several on which it may only have waited."""
        from distributed.scheduler import KilledWorker

        return isinstance(error, (BrokenExecutor, KilledWorker))

    def close(self, _: bool, /) -> None:
        """Leave the cluster; what it still works on for us it drops, or it throws the result away."""
        with suppress(OSError):  # it may be gone itself
            self._client.close(timeout=_CLOSE_S)

    def _workers(self) -> dict[str, Any]:
        found: dict[str, Any] = self._client.scheduler_info(n_workers=-1).get("workers", {})
        return found

    def _count(self, resource: str | None) -> int:
        """Return the number of workers, or of those that say they have a resource."""
        return sum(resource is None or resource in worker["resources"] for worker in self._workers().values())

    def _executor(self, resource: str | None) -> Executor:
        return ClusterExecutor(self._client, {} if resource is None else {resource: 1})

    def _capacity(self, resource: str | None) -> Callable[[], int]:
        workers = self._count(resource)

        def now() -> int:
            nonlocal workers
            if self._client.status == "running":  # a lost scheduler shows in the futures
                with suppress(OSError, RuntimeError):
                    workers = self._count(resource)
            return max(1, workers * (1 + _WAITING_PER_WORKER))

        return now

    def _check(self, address: str, output: Path) -> None:
        with suppress(TimeoutError):
            self._client.wait_for_workers(1, timeout=_FIRST_WORKER_S)
        if not self._workers():
            raise ConfigError(f"scheduler = {address}: it has no workers; start some with 'dask worker {address}'")
        word = secrets.token_hex(8)
        sign = output / WORK_FOLDER / f"seen.{word}"
        sign.write_text(word, "utf-8")
        try:
            answers = self._client.run(look_around, str(sign), on_error="return")
        finally:
            sign.unlink(missing_ok=True)
        for worker, answer in answers.items():
            if isinstance(answer, OSError):
                continue  # it was lost at this moment
            if isinstance(answer, Exception):
                raise InputError(f"{worker}: lfstereo cannot be used there ({answer}); install {__version__} as here")
            seen, version = answer
            if seen != word:
                raise InputError(f"{output}: worker {worker} does not see this folder; put it on shared storage")
            if version != __version__:
                raise InputError(
                    f"{worker}: found lfstereo {version}, expected {__version__} as here; install the same there"
                )


class ClusterExecutor(Executor):
    """The workers of a client that have some resources.

    ``Client.get_executor`` gives futures that fetch each result as soon as there is one, and that hang, fail or print a
    traceback if its worker is lost meanwhile. These fetch it when they are asked, which the answers on the storage make
    needless.
    """

    def __init__(self, client: Any, resources: dict[str, int]) -> None:
        self._client, self._resources = client, resources

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Hand a call to a worker."""
        task = self._client.submit(fn, *args, **kwargs, pure=False, resources=self._resources or None)
        call = ClusterCall(task)
        task.add_done_callback(call.settle)
        return call


class ClusterCall(Future[Any]):
    """A call that is done when the scheduler says so, and whose result stays where it is."""

    def __init__(self, task: Any) -> None:
        super().__init__()
        self._task = task

    def settle(self, task: Any) -> None:
        """Take over how a task ended."""
        if task.status not in ("cancelled", "error"):
            self.set_result(None)
            return
        error: BaseException = CancelledError()
        with suppress(Exception):  # the client may be closed by now
            error = task.exception(_FETCH_S) or error
        self.set_exception(error)

    def result(self, timeout: float | None = None) -> Any:
        """Fetch the result.

        Raises
        ------
        CancelledError
            If the scheduler was lost before there was one.
        BrokenExecutor
            If it was lost with its worker.
        """
        super().result(timeout)
        try:
            return self._task.result(_FETCH_S)
        except (Exception, asyncio.CancelledError) as error:
            raise BrokenExecutor(f"the result was lost: {error}") from error


def look_around(path: str) -> tuple[str, str]:
    """Return, on a worker, what a file holds and the version of lfstereo."""
    try:
        return Path(path).read_text("utf-8"), __version__
    except OSError:
        return "", __version__
