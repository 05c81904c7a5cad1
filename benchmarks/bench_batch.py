"""A batch against a single pair, over a Dask cluster on loopback, and on a simulated schedule of many workers.

Run ``python benchmarks/bench_batch.py SESSION``: a folder with ``captures/``, ``rig.toml`` and ``whites/``, made with
``lfstereo simulate`` if it does not exist (one simulated scene under ten capture times). Parts may be run one by one:
``--part single``, ``batch``, ``cluster``, ``model``; what they measure is kept in ``SESSION/bench.json``. The time of
the processors stands beside the wall time, to tell the work of a pair from what else the machine does.
"""

from __future__ import annotations

import argparse
import heapq
import json
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lfstereo.batch.jobs import Outcome
from lfstereo.batch.record import append, read_record
from lfstereo.container import read_capture, write_capture

PARTS = ("single", "batch", "cluster", "model")
STORAGE_MB_S = (100.0, 1000.0)
"""A disk shared over gigabit Ethernet, and a small parallel file system."""
WORKERS = (1, 2, 10, 100, 1000)
PAIRS_PER_WORKER = 20
_START = "from lfstereo.batch import work; work._HELD.network('binocular-v3', 'cpu')"
_EMPTY_JOBS = 200
_LFSTEREO = [sys.executable, "-m", "lfstereo"]


def main() -> None:
    """Measure the parts that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("session", type=Path)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--part", choices=PARTS, action="append")
    arguments = parser.parse_args()
    session: Path = arguments.session
    make_session(session, arguments.pairs)
    kept = session / "bench.json"
    found: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    for part in arguments.part or PARTS:
        if part == "model":
            print_model(found)
            continue
        found |= {"single": single, "batch": batch, "cluster": cluster}[part](session, arguments.pairs, found)
        kept.write_text(json.dumps(found, indent=2))


def make_session(session: Path, pairs: int) -> None:
    """Write ``pairs`` captures of one scene, each with a time of its own."""
    captures = session / "captures"
    if not captures.exists():
        subprocess.run([*_LFSTEREO, "simulate", "-o", str(captures / "scene00")], check=True)
        for name in ("rig.toml", "whites"):
            shutil.move(captures / "scene00" / name, session / name)
    for side in ("left", "right"):
        missing = [n for n in range(pairs) if not (captures / f"scene{n:02d}" / f"{side}.LFR").exists()]
        if not missing:
            continue
        capture = read_capture(captures / "scene00" / f"{side}.LFR")
        for number in missing:
            metadata = replace(capture.metadata, captured_at=f"2015-05-13T06:{number:02d}:00.000Z")
            (captures / f"scene{number:02d}").mkdir(exist_ok=True)
            write_capture(captures / f"scene{number:02d}" / f"{side}.LFR", replace(capture, metadata=metadata))


def places(session: Path, out: str) -> list[str]:
    """Return the arguments that every command shares; the output starts empty."""
    shutil.rmtree(session / out, ignore_errors=True)
    return ["--rig", str(session / "rig.toml"), "--whites", str(session / "whites"), "-o", str(session / out)]


def single(session: Path, _pairs: int, _found: dict[str, Any]) -> dict[str, Any]:
    """Time ``lfstereo run`` on one pair, from the start of the process to its end, and the start of a worker alone.

    The second run finds the lenslet grids in the user's cache; the first does so too unless the cache was empty.
    """
    pair = session / "captures" / "scene00"
    words = [*_LFSTEREO, "run", str(pair / "left.LFR"), str(pair / "right.LFR")]
    (first, first_cpu), (again, again_cpu) = (timed([*words, *places(session, "one")]) for _ in range(2))
    start, _ = timed([sys.executable, "-c", _START])
    print(f"single pair: {first:.1f} s, again {again:.1f} s; start of a worker and its network: {start:.1f} s")
    print(f"  of processors: {first_cpu:.1f} s, again {again_cpu:.1f} s")
    return {"single_first_s": first, "single_s": again, "single_cpu_s": again_cpu, "start_s": start}


def batch(session: Path, pairs: int, found: dict[str, Any]) -> dict[str, Any]:
    """Time ``lfstereo batch`` on all pairs."""
    took = timed([*_LFSTEREO, "batch", str(session / "captures"), *places(session, "many")])
    return {"batch_s": took[0]} | report("batch", session / "many", pairs, took, found)


def cluster(session: Path, pairs: int, found: dict[str, Any]) -> dict[str, Any]:
    """Time the same over a Dask scheduler and two workers on loopback."""
    with dask_on_loopback(session / "dask", 2) as address:
        words = [*_LFSTEREO, "batch", str(session / "captures"), *places(session, "dasked"), "--scheduler", address]
        took = timed(words)
        overhead = empty_job_s(address, session / "dasked" / "empty.jsonl")
    report("cluster of 2", session / "dasked", pairs, took[:1], found)
    print(f"  an empty job and its line in the record: {overhead * 1e3:.1f} ms")
    return {"cluster_s": took[0], "scheduler_s": overhead}


def empty_job_s(address: str, record: Path) -> float:
    """Return the time that scheduler and client need for a job that does nothing, its line in the record included."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        executor = client.get_executor(pure=False)
        started = time.perf_counter()
        for future in [executor.submit(pow, 2, 3) for _ in range(_EMPTY_JOBS)]:
            future.result()
            append(record, Outcome("empty", "failed"), "", {}, "")
        return (time.perf_counter() - started) / _EMPTY_JOBS


def report(label: str, out: Path, pairs: int, took: tuple[float, ...], found: dict[str, Any]) -> dict[str, Any]:
    """Print time per pair, its ratio to a single pair, memory over the run; return what the model needs."""
    outcomes = [entry.outcome for entry in read_record(out).entries.values() if entry.outcome.state == "done"]
    for kind, single, seconds in zip(("wall", "processors"), ("single_s", "single_cpu_s"), took, strict=False):
        ratio = f", {seconds / pairs / found[single]:.2f} of a single pair" if single in found else ""
        print(f"{label}: {len(outcomes)} pairs in {seconds:.1f} s ({kind}), {seconds / pairs:.1f} s per pair{ratio}")
    for worker in sorted({outcome.workers[-1] for outcome in outcomes}):
        curve = " ".join(f"{outcome.peak_gib:.2f}" for outcome in outcomes if outcome.workers[-1] == worker)
        print(f"  peak GiB of {worker}, pair by pair: {curve}")
    stages = {name: [o.seconds.get(name, 0.0) for o in outcomes] for name in outcomes[-1].seconds}
    for name, values in stages.items():
        print(f"  {name:<22}{sum(values) / len(values):>7.2f} s")
    written = sum(p.stat().st_size for o in outcomes for p in (out / o.name).rglob("*") if p.is_file())
    read = sum(stamp.size for role in ("left", "right") for o in outcomes if (stamp := o.inputs[role]))
    compute = sorted(sum(o.seconds.values()) for o in outcomes)[len(outcomes) // 2]
    return {"compute_s": compute, "read_mb": read / 1e6 / len(outcomes), "written_mb": written / 1e6 / len(outcomes)}


def timed(words: list[str]) -> tuple[float, float]:
    """Return the wall time of a command and the processor time of it and its children."""
    started, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - started, cpu


@contextmanager
def dask_on_loopback(folder: Path, workers: int) -> Iterator[str]:
    """Run a scheduler and workers of one thread each."""
    folder.mkdir(exist_ok=True)
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    dask = [sys.executable, "-m"]
    common = ["--scheduler-file", str(file)]
    start = [
        [*dask, "distributed.cli.dask_scheduler", *common, "--host", "127.0.0.1", "--port", "0"],
        [*dask, "distributed.cli.dask_worker", *common, "--nworkers", str(workers), "--nthreads", "1"],
    ]
    start[1] += ["--local-directory", str(folder)]
    running = [subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for words in start]
    try:
        while not file.exists():
            time.sleep(0.1)
        yield str(json.loads(file.read_text())["address"])
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait()


@dataclass(frozen=True, slots=True)
class Schedule:
    """Simulated run of many workers on one storage and one scheduler."""

    pairs_per_minute: float
    efficiency: float
    """Share of the workers' time spent on computing."""
    storage_busy: float
    scheduler_busy: float


def simulate_schedule(workers: int, compute_s: float, storage_s: float, scheduler_s: float, start_s: float) -> Schedule:
    """Run workers that take turns at a scheduler and at a storage, each first come, first served.

    Parameters
    ----------
    workers
        Number of workers; each gets as many pairs as the others on average.
    compute_s
        Time of a pair on a worker, storage not counted.
    storage_s
        Time that the storage needs for one pair's files.
    scheduler_s
        Time that scheduler and client need for one pair.
    start_s
        What each worker does once: imports, network, white images.
    """
    left = pairs = workers * PAIRS_PER_WORKER
    queue = [(start_s, worker) for worker in range(workers)]
    storage_free = scheduler_free = end = 0.0
    while left:
        now, worker = heapq.heappop(queue)
        scheduler_free = max(scheduler_free, now) + scheduler_s
        storage_free = max(storage_free, scheduler_free) + storage_s
        end = max(end, storage_free + compute_s)
        heapq.heappush(queue, (storage_free + compute_s, worker))
        left -= 1
    return Schedule(
        pairs / end * 60, pairs * compute_s / (workers * end), pairs * storage_s / end, pairs * scheduler_s / end
    )


def print_model(found: dict[str, Any]) -> None:
    """Print where a cluster saturates, from the measured times of a pair."""
    overhead, start = found["scheduler_s"], found["start_s"]
    megabytes = found["read_mb"] + found["written_mb"]
    print(
        f"model: {found['compute_s']:.1f} s and {megabytes:.0f} MB per pair, {overhead * 1e3:.0f} ms at the scheduler"
    )
    print(f"{'storage MB/s':>12}{'workers':>9}{'pairs/min':>11}{'efficiency':>12}{'storage':>9}{'scheduler':>11}")
    for bandwidth in STORAGE_MB_S:
        for workers in WORKERS:
            s = simulate_schedule(workers, found["compute_s"], megabytes / bandwidth, overhead, start)
            print(f"{bandwidth:>12.0f}{workers:>9}{s.pairs_per_minute:>11.1f}{s.efficiency:>12.0%}", end="")
            print(f"{s.storage_busy:>9.0%}{s.scheduler_busy:>11.0%}")


if __name__ == "__main__":
    main()
