"""A hundred captures in one batch under a memory limit, some of them damaged: what is lost, and how memory grows.

``python benchmarks/bench_load.py FOLDER [--count 100] [--damaged 5] [--sensor small] [--memory-gib 6]`` simulates a
pair, makes COUNT of it that differ in noise and time, damages some files at random, runs ``lfstereo batch`` with one
worker whose address space is limited, and prints what became of every pair. Started again, it goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import psutil

from lfstereo.cli.main import main as lfstereo
from lfstereo.container import Capture, read_capture, write_capture

START = datetime(2026, 5, 4, 10, tzinfo=UTC)
DAMAGES = ("cut off", "flipped", "empty", "no container", "zeros inside")


def make_captures(folder: Path, count: int, damaged: int, sensor: str) -> dict[str, str]:
    """Write the captures; return what was done to the damaged ones, by pair."""
    source, notes = folder / "source", folder / "damages.json"
    if notes.is_file():
        done: dict[str, str] = json.loads(notes.read_text("utf-8"))
        return done
    if not source.is_dir():
        assert lfstereo(["simulate", "-o", str(source), "--sensor", sensor]) == 0
    pictures = {side: read_capture(source / f"{side}.LFR") for side in ("left", "right")}
    rng = np.random.default_rng(1)
    for number in range(count):
        place = folder / "captures" / f"scene{number:03d}"
        place.mkdir(parents=True, exist_ok=True)
        for side, picture in pictures.items():
            write_capture(place / f"{side}.LFR", _another(picture, number, rng), force=True)
    chosen = sorted(rng.choice(count, damaged, replace=False))
    damages = {f"scene{number:03d}": DAMAGES[n % len(DAMAGES)] for n, number in enumerate(chosen)}
    for name, what in damages.items():
        _damage(folder / "captures" / name / ("left.LFR", "right.LFR")[rng.integers(2)], what, rng)
    notes.write_text(json.dumps(damages), "utf-8")
    return damages


def _another(picture: Capture, number: int, rng: np.random.Generator) -> Capture:
    noise = rng.integers(-1, 2, picture.mosaic.shape, dtype=np.int32)
    mosaic = np.clip(picture.mosaic + noise, 0, 1023).astype(np.uint16)
    taken = (START + timedelta(seconds=60 * number)).strftime("%Y-%m-%dT%H:%M:%S.000Z")
    return replace(picture, mosaic=mosaic, metadata=replace(picture.metadata, captured_at=taken))


def _damage(path: Path, what: str, rng: np.random.Generator) -> None:
    data = bytearray(path.read_bytes())
    at = int(rng.integers(1000, len(data) - 1000))
    if what == "cut off":
        del data[at:]
    elif what == "flipped":
        data[at] ^= 1 << int(rng.integers(8))
    elif what == "empty":
        data.clear()
    elif what == "no container":
        data[:16] = bytes(range(16))
    else:
        data[at : at + 500] = bytes(500)
    path.write_bytes(data)


def run_batch(folder: Path, memory_gib: float) -> list[tuple[float, float]]:
    """Convert all pairs; return (s, GiB) of resident memory of all its processes, once a second."""
    limit = int(memory_gib * 2**30)
    source = folder / "source"
    words = ["batch", str(folder / "captures"), "--rig", str(source / "rig.toml"), "--whites", str(source / "whites")]
    process = subprocess.Popen(
        [sys.executable, "-m", "lfstereo", *words, "-o", str(folder / "out"), "--workers", "1"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    start, seen = time.monotonic(), []
    while process.poll() is None:
        seen.append((time.monotonic() - start, _resident_gib(process.pid)))
        time.sleep(1)
    print(f"exit code {process.returncode}")
    return seen


def _resident_gib(pid: int) -> float:
    total = 0
    try:
        own = psutil.Process(pid)
        for process in (own, *own.children(recursive=True)):
            total += process.memory_info().rss
    except psutil.Error:
        pass
    return total / 2**30


def report(folder: Path, damages: dict[str, str], count: int, seen: list[tuple[float, float]]) -> None:
    """Print what became of every pair."""
    lines = [json.loads(line) for line in (folder / "out" / "record.jsonl").read_text("utf-8").splitlines()]
    states = {line["pair"]: line["state"] for line in lines}
    whole = {place.name for place in (folder / "out").iterdir() if (place / "run.toml").is_file()}
    good = {f"scene{number:03d}" for number in range(count)} - set(damages)
    spoilt = set(damages) & whole
    print(f"{len(good & whole)} of {len(good)} undamaged pairs converted; of {len(damages)} damaged ones {len(spoilt)}")
    print(f"states in the record: {dict(Counter(states.values()))}")
    quarters = np.array_split([gib for _, gib in seen], 4)
    largest = ", ".join(f"{part.max():.2f}" for part in quarters if len(part))
    print(f"largest resident memory in each quarter of the time, GiB: {largest}")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--damaged", type=int, default=5)
    parser.add_argument("--sensor", default="small")
    parser.add_argument("--memory-gib", type=float, default=6.0)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    damages = make_captures(arguments.folder, arguments.count, arguments.damaged, arguments.sensor)
    print(f"damaged: {damages}", flush=True)
    seen = run_batch(arguments.folder, arguments.memory_gib)
    report(arguments.folder, damages, arguments.count, seen)


if __name__ == "__main__":
    main()
