"""Every end that a call can take in an executor, and what the engine makes of it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lfstereo.batch import engine
from lfstereo.batch.attempts import DISK_FULL, SUPERSEDED
from lfstereo.batch.crew import Step
from lfstereo.batch.engine import Engine
from lfstereo.batch.jobs import Job, Outcome
from lfstereo.batch.notes import Note, keep_answer, write_note

TICK_S = 0.01
DONE = Outcome("a", "done", figures={"valid_share": 0.5})
Play = Callable[[Job, "Future[Outcome]"], Any]


class Stage(Executor):
    """An executor and crew in one: each call is the next play; a play that does nothing hangs."""

    description = "a stage"
    steps = ()

    def __init__(self, *plays: Play) -> None:
        self.plays, self.calls, self.stopped = list(plays), list[Job](), list[Note]()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.calls.append(args[0])
        self.plays.pop(0)(args[0], future)
        return future

    def lost_a_worker(self, error: Exception, /) -> bool:
        return isinstance(error, BrokenExecutor)

    def stop(self, note: Note, /) -> None:
        self.stopped.append(note)

    def close(self, _: bool, /) -> None: ...


def gives(outcome: Outcome) -> Play:
    return lambda job, future: future.set_result(outcome)


def errs(error: BaseException) -> Play:
    return lambda job, future: future.set_exception(error)


def answers(outcome: Outcome, then: Play | None = None) -> Play:
    """Leave an answer on the storage; ``then`` is what the future does, nothing if it hangs."""

    def play(job: Job, future: Future[Outcome]) -> None:
        keep_answer(job, outcome)
        if then is not None:
            then(job, future)

    return play


@pytest.fixture
def job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Job:
    monkeypatch.setattr(engine, "_TICK_S", TICK_S)
    return Job("a", tmp_path, "mine", 1, 600.0)


def run(job: Job, *stages: Stage) -> tuple[list[Outcome], str]:
    """Run a job through steps, one stage each; return how it ended and why the engine stopped."""
    ended: list[Outcome] = []
    steps = [Step(lambda job: DONE, stage, lambda: 1) for stage in stages]
    stopped = Engine(stages[0], steps, ended.append, lambda notes: None).run([job])
    return ended, stopped


def test_future_that_gives_its_result(job: Job) -> None:
    assert run(job, Stage(gives(DONE))) == ([DONE], "")


@pytest.mark.parametrize("error", [CancelledError("its data are lost"), TypeError("not a tuple"), BrokenExecutor()])
def test_future_that_fails_wrongly(job: Job, error: BaseException) -> None:
    """The worker had left its answer; whatever the way of its result meets does not count."""
    assert run(job, Stage(answers(DONE, errs(error)))) == ([DONE], "")


def test_future_that_hangs(job: Job) -> None:
    assert run(job, Stage(answers(DONE))) == ([DONE], "")


def test_answer_of_one_step_is_not_that_of_the_next(job: Job) -> None:
    focused = Outcome("a", "focused", warnings=("dark",))
    second = Stage(errs(BrokenExecutor()), gives(DONE))
    ended, stopped = run(job, Stage(answers(focused)), second)
    assert (ended, stopped) == ([replace(DONE, warnings=("dark",))], "")
    assert second.calls[0] == second.calls[1]
    assert second.calls[0].token != job.token


def test_lost_worker_is_tried_again_and_given_up(job: Job) -> None:
    assert run(job, Stage(errs(BrokenExecutor()), gives(DONE))) == ([DONE], "")
    (ended,), _ = run(job, Stage(errs(BrokenExecutor()), errs(BrokenExecutor())))
    assert ended.kind == "worker lost"
    assert "its worker was lost 2 times" in ended.reason


def test_worker_lost_beyond_the_time_limit_is_not_tried_again(job: Job) -> None:
    write_note(job.note, Note("mine", 1, "host", 1, "disparity", 0.0, "time limit"))
    (ended,), _ = run(job, Stage(errs(BrokenExecutor())))
    assert ended.reason.startswith("stopped after 600 s in stage 'disparity'")


def test_work_that_was_taken_over_by_none_of_ours_is_done_again(job: Job) -> None:
    """A cluster may start what a dead batch had handed out, beside what this one has."""
    stage = Stage(gives(Outcome("a", "failed", "taken over", SUPERSEDED)), gives(DONE))
    assert run(job, stage) == ([DONE], "")


def test_error_of_the_executor_is_the_pairs(job: Job) -> None:
    (ended,), stopped = run(job, Stage(errs(ModuleNotFoundError("No module named 'lfstereo'"))))
    assert (ended.reason, ended.kind) == ("worker: No module named 'lfstereo'", "ModuleNotFoundError")
    assert stopped == ""


def test_lost_scheduler_and_full_disk_stop_all(job: Job) -> None:
    assert run(job, Stage(errs(CancelledError()))) == ([], "the scheduler was lost")
    full = Outcome("a", "failed", "the disk is full", DISK_FULL)
    assert run(job, Stage(gives(full))) == ([full], "the disk is full")


def test_closed_client_stops_all(job: Job) -> None:
    def closed(job: Job, future: Future[Outcome]) -> None:
        raise RuntimeError("client is closed")

    assert run(job, Stage(closed)) == ([], "no work can be handed out (client is closed)")


def test_worker_that_does_not_end_itself_is_stopped(job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_GRACE_S", 0.0)
    note = Note("mine", 1, "host", 7, "disparity", 0.0)

    class Hanging(Stage):
        def stop(self, found: Note, /) -> None:
            super().stop(found)
            pending.set_exception(BrokenExecutor())

    pending: Future[Outcome] = Future()

    def hangs(job: Job, future: Future[Outcome]) -> None:
        nonlocal pending
        pending = future
        write_note(job.note, note)

    stage = Hanging(hangs)
    (ended,), _ = run(replace(job, time_limit_s=0.0), stage)
    assert stage.stopped[0] == note
    assert ended.reason.startswith("stopped after 0 s in stage 'disparity'")
