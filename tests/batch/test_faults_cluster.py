"""A real Dask scheduler and workers on loopback, killed in turn; each test says what survived."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from lfstereo.batch.record import read_record

FAILED_PART = 5
_MAIN = {"scheduler": "distributed.cli.dask_scheduler", "worker": "distributed.cli.dask_worker"}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Cluster:
    """A scheduler and the workers that were started for it."""

    folder: Path
    port: int = field(default_factory=free_port)
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def address(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    def start(self, kind: str, *words: str) -> subprocess.Popen[bytes]:
        """Start a scheduler or workers; the stub's conversion can be imported there."""
        paths = [str(Path(__file__).parent), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, paths)), PYTHONWARNINGS="ignore")
        log = (self.folder / f"{kind}{len(self.processes)}.log").open("wb")
        with log:
            process = subprocess.Popen(
                [sys.executable, "-m", _MAIN[kind], *words], stderr=log, env=environment, start_new_session=True
            )
        self.processes.append(process)
        return process

    def start_scheduler(self) -> subprocess.Popen[bytes]:
        return self.start("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--dashboard-address", ":0")

    def start_workers(self, count: int, *words: str) -> None:
        common = ["--nthreads", "1", "--no-dashboard", "--local-directory", str(self.folder), "--death-timeout", "60"]
        self.start("worker", self.address, "--nworkers", str(count), *common, *words)

    def is_complete(self) -> bool:
        """Return whether the scheduler has both workers."""
        text = (self.folder / "scheduler0.log").read_text(errors="replace")
        return text.count("Register worker addr") - text.count("Remove worker addr") == 2

    def stop(self) -> None:
        for process in reversed(self.processes):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler with two workers, one of them with a GPU by its own account."""
    found = Cluster(tmp_path_factory.mktemp("cluster"))
    try:
        found.start_scheduler()
        found.start_workers(1, "--resources", "CPU=1")
        found.start_workers(1, "--resources", "GPU=1")
        yield found
    finally:
        found.stop()


def start(site: Any, cluster: Cluster, *more: str) -> Any:
    return site.start("--scheduler", cluster.address, *more)


def test_pairs_pass_through_both_kinds_of_worker(site: Any, cluster: Cluster) -> None:
    """A plain worker decodes, the one with the GPU has the network; errors stay with their pair."""
    site.wait_until(cluster.is_complete, "both workers")
    site.pairs("ok1", "ok2", "bad", "bug")
    code, printed = site.end_of(start(site, cluster))
    assert code == FAILED_PART, printed
    assert site.visible() == {"ok1", "ok2"}
    assert "2 workers (1 with GPU)" in printed
    assert re.search(r"dashboard http://127\.0\.0\.1:\d+/status", printed)
    entries = read_record(site.out).entries
    lasts = {entries[name].outcome.workers[-1] for name in ("ok1", "ok2")}
    assert len(lasts) == 1, "one worker has the GPU"
    assert all(len(entries[name].outcome.workers) == 2 for name in ("ok1", "ok2"))


def test_worker_killed_in_mid_run_or_as_its_answer_is_fetched(site: Any, cluster: Cluster) -> None:
    """Survived: all pairs, nothing half ever shows; a finished pair is not done again: its answer is on the storage."""
    site.wait_until(cluster.is_complete, "both workers")
    site.pairs("late3", "mute", "ok", "wait")
    batch = start(site, cluster, "--retries", "5")
    killed = site.worker_at("wait", "write results")
    os.kill(killed, signal.SIGKILL)
    site.wait_until(lambda: (n := site.note("wait")) and n["process"] != killed, "another attempt")
    assert "wait" not in site.visible()
    (site.folder / "go").touch()
    code, printed = site.end_of(batch)
    assert code == 0, printed
    assert "4 converted, 0 kept, 0 failed, 0 not done" in printed
    assert "Traceback" not in printed
    assert site.visible() == {"late3", "mute", "ok", "wait"}
    assert site.attempts()["late3"] == 1
    assert site.attempts()["wait"] > 1


def test_pair_that_hangs_or_kills(site: Any, cluster: Cluster) -> None:
    """Survived: the others; the worker stuck in compiled code ends itself, its nanny starts it anew."""
    site.wait_until(cluster.is_complete, "both workers")
    site.pairs("die", "ok", "stuck")
    code, printed = site.end_of(start(site, cluster, "--time-limit-s", "3", "--retries", "0"))
    assert code == FAILED_PART, printed
    assert site.visible() == {"ok"}, printed
    assert "stopped after 3 s in stage 'decode left'" in site.reason("stuck")
    assert "its worker was lost once" in site.reason("die")


def test_client_killed_in_mid_run(site: Any, cluster: Cluster) -> None:
    """Survived: the finished pair; what the cluster still makes for the dead client is thrown away."""
    site.wait_until(cluster.is_complete, "both workers")
    site.pairs("ok", "wait")
    batch = start(site, cluster)
    site.worker_at("wait", "write results")
    stale = site.note("wait")["token"]
    site.wait_until(lambda: site.states().get("ok") == "done", "the first pair")
    before = site.maker("ok")
    os.kill(batch.pid, signal.SIGKILL)
    again = start(site, cluster)
    site.wait_until(lambda: (site.note("wait") or {"token": ""})["token"] != stale, "the new batch's clean start")
    (site.folder / "go").touch()
    code, printed = site.end_of(again)
    assert code == 0, printed
    assert "1 converted, 1 kept" in printed
    assert site.maker("ok") == before
    assert site.visible() == {"ok", "wait"}


def test_scheduler_killed_in_mid_run(site: Any, cluster: Cluster) -> None:
    """Survived: the finished pair; the batch ends and says so, and goes on with a new scheduler."""
    site.wait_until(cluster.is_complete, "both workers")
    site.pairs("ok", *(f"wait{n}" for n in range(5)))
    batch = start(site, cluster)
    site.worker_at("wait0", "write results")
    site.wait_until(lambda: site.states().get("ok") == "done", "the first pair")
    os.kill(cluster.processes[0].pid, signal.SIGKILL)
    code, printed = site.end_of(batch)
    assert code == FAILED_PART, printed
    assert "stopped: " in printed
    assert "1 converted, 0 kept, 0 failed, 5 not done" in printed
    assert site.visible() == {"ok"}
    (site.folder / "go").touch()
    code, printed = site.run()
    assert (code, "5 converted, 1 kept" in printed) == (0, True)


def test_no_scheduler(site: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    site.pairs("ok")
    monkeypatch.setattr("lfstereo.batch.cluster._CONNECT_S", 1)
    from lfstereo.batch.cluster import ClusterCrew
    from lfstereo.errors import ConfigError

    with pytest.raises(ConfigError, match="found no Dask scheduler"):
        ClusterCrew(f"tcp://127.0.0.1:{free_port()}", site.out, None)  # type: ignore[arg-type]
