"""One attempt at a job: what it leaves, and when it is out of date."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lfstereo.batch.attempts import SUPERSEDED, NotingClock, attempt, verdict_on_loss
from lfstereo.batch.jobs import Job, Outcome
from lfstereo.batch.notes import Note, lost_note, mark_stopped, read_answer, read_note, trace_of, write_note
from lfstereo.batch.stamps import FileStamp

LIMIT_S = 600.0


@pytest.fixture
def job(tmp_path: Path) -> Job:
    return Job("a", tmp_path, "mine", 1, LIMIT_S)


def test_stages_are_noted_while_they_run(job: Job) -> None:
    def body(job: Job, clock: NotingClock) -> Outcome:
        with clock.stage("decode left"):
            note = read_note(job.note)
            assert note is not None
            assert (note.stage, note.token, note.attempt) == ("decode left", "mine", 1)
        return Outcome(job.name, "done")

    outcome = attempt(job, body)
    assert outcome.state == "done"
    assert set(outcome.seconds) == {"decode left"}
    assert outcome.peak_gib > 0
    assert read_note(job.note) is None


def test_attempt_that_was_taken_over_shows_nothing(job: Job) -> None:
    """Work of a dead batch that still runs on a cluster finds another batch's note."""
    theirs = Note("theirs", 1, "host", 1, "start", 0.0)

    def shows(job: Job, clock: NotingClock) -> Outcome:
        write_note(job.note, theirs)
        clock.check_not_superseded()
        raise AssertionError("not refused")

    def goes_on(job: Job, clock: NotingClock) -> Outcome:
        write_note(job.note, theirs)
        with clock.stage("rectify left"):
            raise AssertionError("not refused")

    def times_out(job: Job, clock: NotingClock) -> Outcome:
        write_note(job.note, theirs)
        mark_stopped(job.note, clock.note, "time limit")
        return Outcome(job.name, "done")

    for body in (shows, goes_on):
        outcome = attempt(job, body)
        assert (outcome.state, outcome.kind) == ("failed", SUPERSEDED)
        assert read_note(job.note) == theirs
    attempt(job, times_out)
    assert read_note(job.note) == theirs
    assert read_answer(job) is None


def test_answer_is_left_and_the_work_not_done_again(job: Job) -> None:
    """A cluster repeats a call whose worker was lost before it gave its answer."""

    def body(job: Job, clock: NotingClock) -> Outcome:
        with clock.stage("disparity"):
            stamps = {"left": FileStamp("/x", 7, 8, "9")}
        return Outcome(job.name, "done", inputs=stamps, figures={"valid_share": 0.5}, warnings=("dark",))

    def again(job: Job, clock: NotingClock) -> Outcome:
        raise AssertionError("done twice")

    outcome = attempt(job, body)
    assert read_answer(job) == outcome
    assert attempt(job, again) == outcome
    assert read_answer(replace(job, token="of the next step")) is None
    job.answer.write_text(job.answer.read_text()[:40])
    assert read_answer(job) is None


def test_lost_attempts_are_counted_by_the_note(job: Job) -> None:
    def body(job: Job, clock: NotingClock) -> Outcome:
        return Outcome(job.name, "done")

    lost = Note("mine", 1, "host", 1, "disparity", 0.0)
    write_note(job.note, lost)
    assert attempt(job, body).attempt == 2
    job.answer.unlink()
    write_note(job.note, replace(lost, attempt=2))
    refused = attempt(job, body)
    assert refused.state == "failed"
    assert "lost 2 times, last in stage 'disparity' on host:1" in refused.reason
    assert read_answer(job) == refused
    job.answer.unlink()
    write_note(job.note, replace(lost, token="an earlier batch", attempt=9))
    assert attempt(job, body).attempt == 1


def test_attempt_that_hung_without_last_words(job: Job) -> None:
    """Its process was ended from outside the interpreter, which left where it hung."""
    write_note(job.note, Note("mine", 1, "host", 1, "disparity", 0.0))
    trace_of(job, 1).write_text("")
    assert lost_note(job) == read_note(job.note)
    trace_of(job, 1).write_text("Timeout (0:10:02)!")
    refused = attempt(job, lambda job, clock: Outcome(job.name, "done"))
    assert refused.reason.startswith("stopped after 600 s in stage 'disparity'")


def test_time_limit_is_not_tried_again(job: Job) -> None:
    verdict = verdict_on_loss(job, Note("mine", 1, "host", 1, "disparity", 0.0, "time limit"))
    assert verdict is not None
    assert verdict.reason.startswith("stopped after 600 s in stage 'disparity'")
    assert verdict_on_loss(job, Note("mine", 1, "host", 1, "disparity", 0.0)) is None


def test_output_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / ".batch").write_text("a file in the way")
    outcome = attempt(Job("a", tmp_path, "mine", 0, LIMIT_S), lambda job, clock: Outcome(job.name, "done"))
    assert outcome.state == "failed"
    assert ".batch" in outcome.reason
