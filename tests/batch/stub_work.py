"""Stands in for the conversion of a pair, so that faults are tested in seconds: the pair's name tells what happens.

Everything around it is the real thing: processes, notes, time limit, folders, record. As a program it is ``lfstereo``
with this conversion: ``python stub_work.py batch CAPTURES ...``.
"""

from __future__ import annotations

import ctypes
import errno
import functools
import os
import signal
import sys
import threading
import time
from pathlib import Path

from lfstereo.batch import conversion
from lfstereo.batch.attempts import NotingClock, attempt
from lfstereo.batch.crew import PairWork
from lfstereo.batch.figures import THUMBNAIL
from lfstereo.batch.jobs import Outcome, PairJob
from lfstereo.batch.stamps import model_sha256, result_sha256, stamp
from lfstereo.errors import ContainerError
from lfstereo.outputs import atomic_folder

_LONG_S = 120
_BIG_BYTES = 3 << 20
_MOMENT_S = 0.002


def whole(job: PairJob) -> Outcome:
    """All steps."""
    return _answered(job, attempt(job, _whole))


def focus(job: PairJob) -> Outcome:
    """The first step of two."""
    return attempt(job, _focus)


def match(job: PairJob) -> Outcome:
    """The second step of two."""
    return _answered(job, attempt(job, _match))


def _whole(job: PairJob, clock: NotingClock) -> Outcome:
    with clock.stage("decode left"):
        _behave(job)
    return _write(job, clock)


def _focus(job: PairJob, clock: NotingClock) -> Outcome:
    with clock.stage("decode left"):
        _behave(job)
    job.focused.parent.mkdir(exist_ok=True)
    job.focused.write_text(str(os.getpid()))
    return Outcome(job.name, "focused", inputs={"left": stamp(job.left)})


def _match(job: PairJob, clock: NotingClock) -> Outcome:
    assert int(job.focused.read_text()) > 0
    outcome = _write(job, clock)
    job.focused.unlink()
    return outcome


def _write(job: PairJob, clock: NotingClock) -> Outcome:
    paths = {"left": job.left, "right": job.right, "rig": job.rig}
    inputs = {role: stamp(path) for role, path in paths.items()}
    with atomic_folder(job.folder, force=True) as out:
        (out / "run.toml").write_text(f"by = {os.getpid()}\n")
        with clock.stage("write results"):
            if job.name.startswith("big"):
                (out / "depth.tiff").write_bytes(bytes(_BIG_BYTES))
            if job.name.startswith("wait"):
                _until(job.output.parent / "go")
        (out / THUMBNAIL).write_bytes(b"")
        made = result_sha256(out)
        clock.check_not_superseded()
    weights, figures = model_sha256(job.options.model), {"valid_share": 0.5}
    return Outcome(job.name, "done", inputs=inputs, weights_sha256=weights, result_sha256=made, figures=figures)


def _answered(job: PairJob, outcome: Outcome) -> Outcome:
    """Die once with the answer that was left already: ``mute`` before it is given, ``late3`` three moments after."""
    if job.name.startswith("mute") and _first_time(job):
        os.kill(os.getpid(), signal.SIGKILL)
    if job.name.startswith("late") and _first_time(job):
        threading.Timer(int(job.name[-1]) * _MOMENT_S, os.kill, (os.getpid(), signal.SIGKILL)).start()
    return outcome


def _first_time(job: PairJob) -> bool:
    marker = job.output.parent / f"{job.name}.died"
    if marker.exists():
        return False
    marker.touch()
    return True


def _behave(job: PairJob) -> None:
    match job.name.rstrip("0123456789"):
        case "hang":
            time.sleep(_LONG_S)
        case "stuck":
            ctypes.PyDLL(None).sleep(_LONG_S)  # keeps the interpreter's lock, so that no other thread runs
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case "dieonce" if _first_time(job):
            os.kill(os.getpid(), signal.SIGKILL)
        case "memory":
            raise MemoryError("Unable to allocate 9.9 GiB")
        case "bad":
            raise ContainerError(f"{job.left}: byte 7: the file is cut off, copy it again from the camera")
        case "forbidden":
            raise PermissionError(errno.EACCES, "Permission denied", str(job.left))
        case "bug":
            raise ZeroDivisionError("division by zero")


def _until(sign: Path) -> None:
    end = time.monotonic() + _LONG_S
    while not sign.exists() and time.monotonic() < end:
        time.sleep(0.02)


STUB = PairWork(whole, focus, match)

if __name__ == "__main__":
    import stub_work

    from lfstereo.cli.main import main

    conversion.run_batch = functools.partial(conversion.run_batch, work=stub_work.STUB)
    sys.exit(main())
