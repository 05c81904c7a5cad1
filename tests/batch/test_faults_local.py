"""Local workers and clients that are killed, hang or meet errors; each test says what survived."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
from typing import Any

import pytest

from lfstereo.batch.record import read_record

FAILED_PART = 5
"""Exit code of a batch of which a part failed."""


def test_errors_stay_with_their_pair(site: Any) -> None:
    """Survived: every other pair; the record names each failure on one line."""
    site.pairs("bad", "memory", "bug", "forbidden", "ok1", "ok2")
    code, printed = site.run()
    assert code == FAILED_PART
    assert site.visible() == {"ok1", "ok2"}
    assert site.states() == {"ok1": "done", "ok2": "done"} | dict.fromkeys(
        ("bad", "memory", "bug", "forbidden"), "failed"
    )
    assert "cut off" in site.reason("bad")
    assert "out of memory" in site.reason("memory")
    assert site.reason("bug").startswith("bug: division by zero (stub_work.py, line ")
    assert "Permission denied" in site.reason("forbidden")
    assert "Traceback" not in printed
    assert "2 converted, 0 kept, 4 failed, 0 not done" in printed
    code, printed = site.run()
    assert (code, "0 converted, 2 kept, 4 failed" in printed) == (FAILED_PART, True)


def test_worker_killed_once(site: Any) -> None:
    """Survived: all pairs; in mid-work at the second attempt, with the answer for a finished pair at the first."""
    site.pairs("dieonce", "mute", "ok")
    code, _ = site.run()
    assert code == 0
    assert site.visible() == {"dieonce", "mute", "ok"}
    assert site.attempts() == {"dieonce": 2, "mute": 1, "ok": 1}


def test_worker_killed_from_outside_in_mid_write(site: Any) -> None:
    """Survived: all pairs; what the killed worker had begun never showed."""
    site.pairs("wait", "ok")
    batch = site.start("--workers", "2")
    pid = site.worker_at("wait", "write results")
    os.kill(pid, signal.SIGKILL)
    second = site.wait_until(lambda: (n := site.note("wait")) and n["attempt"] == 2 and n, "the second attempt")
    assert second["process"] != pid
    assert "wait" not in site.visible()
    (site.folder / "go").touch()
    code, _ = site.end_of(batch)
    assert code == 0
    assert site.visible() == {"wait", "ok"}
    assert not site.is_running(second["process"])
    assert not list(site.out.glob(".*.partial"))


def test_pairs_that_kill_or_hang_their_worker(site: Any) -> None:
    """Survived: the others; one is given up after its retries, two end at the time limit, even in compiled code."""
    site.pairs("die", "hang", "ok", "stuck")
    code, _ = site.run("--time-limit-s", "3", "--retries", "1")
    assert code == FAILED_PART
    assert site.visible() == {"ok"}
    assert "its worker was lost 2 times, last in stage 'decode left'" in site.reason("die")
    assert "stopped after 3 s in stage 'decode left'" in site.reason("hang")
    assert "stopped after 3 s in stage 'decode left'" in site.reason("stuck")


def test_client_killed_in_mid_run_and_started_again(site: Any) -> None:
    """Survived: the finished pair, not redone; its workers went with it, and nothing half is seen or left."""
    site.pairs("ok", "wait")
    batch = site.start()
    worker = site.worker_at("wait", "write results")
    before = site.maker("ok")
    os.kill(batch.pid, signal.SIGKILL)
    batch.wait()
    site.wait_until(lambda: not site.is_running(worker), "the end of the orphaned worker")
    assert site.visible() == {"ok"}
    assert list(site.out.glob(".wait.*.partial"))
    (site.folder / "go").touch()
    code, printed = site.run()
    assert code == 0
    assert "1 converted, 1 kept" in printed
    assert site.maker("ok") == before
    assert site.visible() == {"ok", "wait"}
    assert not list(site.out.glob(".*.partial"))


def test_interrupt_from_the_keyboard(site: Any) -> None:
    """Survived: the finished pair; workers end, nothing partial is left."""
    site.pairs("ok", "wait")
    batch = site.start(preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # a shell's "&" ignores it
    worker = site.worker_at("wait", "write results")
    os.kill(batch.pid, signal.SIGINT)
    code, printed = site.end_of(batch)
    assert code == 130
    assert "interrupted" in printed
    assert not site.is_running(worker)
    assert site.visible() == {"ok"}
    assert not list(site.out.glob(".*.partial"))


def test_two_batches_on_one_folder(site: Any) -> None:
    """Survived: the first, untouched; the second is refused."""
    site.pairs("wait", "ok")
    first = site.start()
    site.worker_at("wait", "write results")
    code, printed = site.run()
    assert code == 3
    assert "writes here; wait for it" in printed
    (site.folder / "go").touch()
    assert site.end_of(first)[0] == 0
    assert site.states() == {"wait": "done", "ok": "done"}


def test_shards_work_side_by_side(site: Any) -> None:
    """Each takes its part, lets the other's notes be and writes its own record; the summary is of both."""
    site.pairs("wait", "wait.2")
    second = site.start("--shard", "2/2")
    site.worker_at("wait.2", "write results")
    first = site.start("--shard", "1/2")
    site.worker_at("wait", "write results")
    assert site.note("wait.2"), "its name begins with the other's"
    (site.folder / "go").touch()
    for batch in (first, second):
        code, printed = site.end_of(batch)
        assert (code, "1 converted" in printed) == (0, True), printed
    assert site.states() == {"wait": "done", "wait.2": "done"}
    assert "not done" not in (site.out / "summary.csv").read_text()


def test_disk_full(site: Any) -> None:
    """Survived: the pairs before; the batch stops, and goes on once there is room."""
    site.out.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(site.out)], capture_output=True)
    if mounted.returncode:
        pytest.skip(f"no tmpfs can be mounted here: {mounted.stderr.decode().strip()}")
    try:
        site.pairs("a", "big", "c")
        code, printed = site.run()
        assert code == FAILED_PART
        assert "the disk is full" in site.reason("big")
        assert "1 converted, 0 kept, 1 failed, 1 not done" in printed
        assert site.visible() == {"a"}
        assert not list(site.out.glob(".*.partial"))
        subprocess.run(["mount", "-o", "remount,size=20m", str(site.out)], check=True)
        code, printed = site.run()
        assert (code, "2 converted, 1 kept" in printed) == (0, True)
        assert site.visible() == {"a", "big", "c"}
    finally:
        subprocess.run(["umount", str(site.out)], check=True)


def test_record_that_cannot_grow(site: Any) -> None:
    """Survived: the record so far; the batch ends with one line when it can write no more of it."""
    site.pairs("ok1", "ok2")
    assert site.run()[0] == 0
    record = site.out / "record.jsonl"
    size = record.stat().st_size
    site.pairs("ok3")
    small = size + 100

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (small, small))

    code, printed = site.end_of(site.start(preexec_fn=limited))
    assert code == 3, printed
    assert "record.jsonl: cannot be written (File too large)" in printed
    assert site.states() == {"ok1": "done", "ok2": "done"}
    code, printed = site.run()
    assert (code, "1 converted, 2 kept" in printed) == (0, True)


def test_two_lanes_hand_over(site: Any) -> None:
    """With a worker for the network alone, each pair passes through two processes, and nothing is left between."""
    site.pairs("ok1", "ok2")
    code, _ = site.run("--network-workers", "1")
    assert code == 0
    for entry in read_record(site.out).entries.values():
        first, second = entry.outcome.workers
        assert first != second
    assert not list((site.out / ".batch" / "focused").iterdir())
