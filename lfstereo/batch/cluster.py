"""Workers of a Dask cluster that somebody else started; extra ``cluster``."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lfstereo import __version__
from lfstereo.batch.crew import PairWork, Step
from lfstereo.batch.jobs import WORK_FOLDER
from lfstereo.batch.notes import Note
from lfstereo.errors import ConfigError, InputError, MissingExtraError

GPU = "GPU"
"""Name of the resource that tells workers with a GPU: ``dask worker --resources GPU=1``."""
_CONNECT_S = 20
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
        except BaseException:
            self._client.close()
            raise
        plain, gpus = self._addresses(False), self._addresses(True)
        if plain and gpus:
            near = self._client.get_executor(pure=False, workers=plain, allow_other_workers=True)
            with_gpu = self._client.get_executor(pure=False, resources={GPU: 1})
            self.steps: tuple[Step, ...] = (
                Step(work.focus, near, self._capacity(False)),
                Step(work.match, with_gpu, self._capacity(True)),
            )
        else:
            everyone = self._client.get_executor(pure=False)
            self.steps = (Step(work.whole, everyone, self._capacity(None)),)
        self.description = (
            f"{len(plain) + len(gpus)} workers ({len(gpus)} with {GPU}) of {address}; "
            f"dashboard {self._client.dashboard_link}"
        )

    def stop(self, _: Note, /) -> bool:
        """Do nothing: a worker of a cluster can only end itself."""
        return False

    def close(self, at_once: bool) -> None:
        """Leave the cluster; it goes on without us."""
        for step in self.steps if at_once else ():
            step.executor.shutdown(wait=False)
        self._client.close(timeout=5)

    def _workers(self) -> dict[str, Any]:
        found: dict[str, Any] = self._client.scheduler_info(n_workers=-1)["workers"]
        return found

    def _addresses(self, gpu: bool) -> list[str]:
        return [address for address, worker in self._workers().items() if bool(worker["resources"].get(GPU)) == gpu]

    def _capacity(self, gpu: bool | None) -> Callable[[], int]:
        def now() -> int:
            count = len(self._workers()) if gpu is None else len(self._addresses(gpu))
            return max(1, count * (1 + _WAITING_PER_WORKER))

        return now

    def _check(self, address: str, output: Path) -> None:
        if not self._workers():
            raise ConfigError(f"scheduler = {address}: it has no workers; start some with 'dask worker {address}'")
        word = secrets.token_hex(8)
        sign = output / WORK_FOLDER / f"seen.{word}"
        sign.write_text(word, "utf-8")
        try:
            answers = self._client.run(look_around, str(sign))
        finally:
            sign.unlink(missing_ok=True)
        for worker, (seen, version) in answers.items():
            if seen != word:
                raise InputError(f"{output}: worker {worker} does not see this folder; put it on shared storage")
            if version != __version__:
                raise InputError(
                    f"{worker}: found lfstereo {version}, expected {__version__} as here; install the same there"
                )


def look_around(path: str) -> tuple[str, str]:
    """Return, on a worker, what a file holds and the version of lfstereo."""
    try:
        return Path(path).read_text("utf-8"), __version__
    except OSError:
        return "", __version__
