"""A crew of a Dask cluster without the cluster: whom it refuses, and how its calls end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError
from pathlib import Path
from typing import Any

import distributed
import pytest
from distributed.scheduler import KilledWorker

from lfstereo import __version__
from lfstereo.batch.cluster import ClusterCall, ClusterCrew, ClusterExecutor, look_around
from lfstereo.batch.crew import PairWork
from lfstereo.batch.jobs import Outcome
from lfstereo.errors import ConfigError, InputError

WORK = PairWork(*(lambda job, state=state: Outcome(job.name, state) for state in ("done", "focused", "done")))


class Client:
    """Stands in for Dask's."""

    status, dashboard_link = "running", "http://host:8787/status"

    def __init__(self, resources: list[str], look: Callable[[str], Any]) -> None:
        self.workers = {f"tcp://w{n}": {"resources": {name: 1} if name else {}} for n, name in enumerate(resources)}
        self.look, self.closed, self.submitted = look, False, list[dict[str, Any]]()

    def wait_for_workers(self, count: int, timeout: float) -> None:
        if not self.workers:
            raise TimeoutError

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        return {"workers": self.workers}

    def run(self, function: Any, path: str, on_error: str) -> dict[str, Any]:
        return {worker: self.look(path) for worker in self.workers}

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        self.submitted.append(kwargs)
        return Task("finished", fn(*args))

    def close(self, timeout: float) -> None:
        self.closed = True
        raise TimeoutError("as where the scheduler is gone")


class Task:
    """Stands in for Dask's future."""

    def __init__(self, status: str, end: Any) -> None:
        self.status, self.end = status, end

    def add_done_callback(self, fn: Callable[[Any], None]) -> None:
        fn(self)

    def exception(self, timeout: float) -> BaseException | None:
        return self.end if self.status == "error" else None

    def result(self, timeout: float) -> Any:
        if isinstance(self.end, BaseException):
            raise self.end
        return self.end


@pytest.fixture
def crew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[ClusterCrew, Client]]:
    """Meet a cluster whose workers have some resources and see something."""
    (tmp_path / ".batch").mkdir()

    def meet(resources: list[str], look: Callable[[str], Any] = look_around) -> tuple[ClusterCrew, Client]:
        client = Client(resources, look)
        monkeypatch.setattr(distributed, "Client", lambda *_, **__: client)
        return ClusterCrew("tcp://host:8786", tmp_path, WORK), client

    return meet


def raises(error: BaseException) -> Callable[[str], Any]:
    def look(path: str) -> Any:
        raise error

    return look


@pytest.mark.parametrize(
    ("workers", "look", "kind", "message"),
    [
        ([], look_around, ConfigError, "it has no workers; start some"),
        ([""], lambda path: look_around(path + "gone"), InputError, "worker tcp://w0 does not see this folder"),
        (
            [""],
            lambda path: (look_around(path)[0], "0.0.1"),
            InputError,
            f"found lfstereo 0.0.1, expected {__version__}",
        ),
        ([""], lambda path: ModuleNotFoundError("No module named 'lfstereo'"), InputError, "cannot be used there"),
        ([""], raises(OSError("comm closed")), ConfigError, "lost while its workers were looked at"),
    ],
)
def test_cluster_that_cannot_be_used(
    crew: Any, workers: list[str], look: Callable[[str], Any], kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        crew(workers, look)


def test_worker_lost_at_this_moment_is_passed_over(crew: Any) -> None:
    crew([""], lambda path: OSError("comm closed"))


@pytest.mark.parametrize(
    ("workers", "wanted", "capacities"),
    [
        (["", ""], [None], [4]),
        (["GPU", "GPU"], [None], [4]),
        (["CPU", "GPU", "CPU"], [{"CPU": 1}, {"GPU": 1}], [4, 2]),
        (["", "GPU"], [None, {"GPU": 1}], [4, 2]),
    ],
)
def test_who_does_what(crew: Any, workers: list[str], wanted: list[Any], capacities: list[int]) -> None:
    found, client = crew(workers)
    for step in found.steps:
        step.executor.submit(len, ())
    assert [call["resources"] for call in client.submitted] == wanted
    assert [step.capacity() for step in found.steps] == capacities
    client.status, client.workers = "connecting", {}
    assert [step.capacity() for step in found.steps] == capacities, "a scheduler that is lost is not asked"
    found.close(True)
    assert client.closed


def test_call_gives_its_result() -> None:
    assert ClusterExecutor(Client([], look_around), {}).submit(len, "abc").result() == 3


@pytest.mark.parametrize("error", [asyncio.CancelledError(), TimeoutError(), OSError("its worker is gone")])
def test_result_lost_with_its_worker(crew: Any, error: BaseException) -> None:
    call = settled(Task("finished", error))
    with pytest.raises(BrokenExecutor, match="the result was lost") as caught:
        call.result()
    assert crew([""])[0].lost_a_worker(caught.value)


def test_call_that_failed_or_was_given_up(crew: Any) -> None:
    with pytest.raises(ZeroDivisionError):
        settled(Task("error", ZeroDivisionError())).result()
    with pytest.raises(KilledWorker) as caught:
        settled(Task("error", KilledWorker("task", None, 3))).result()  # type: ignore[arg-type]
    found, _ = crew([""])
    assert found.lost_a_worker(caught.value)
    assert not found.lost_a_worker(ZeroDivisionError())


def test_call_of_a_lost_scheduler() -> None:
    with pytest.raises(CancelledError):
        settled(Task("cancelled", None)).result()


def settled(task: Task) -> ClusterCall:
    call = ClusterCall(task)
    call.settle(task)
    return call
