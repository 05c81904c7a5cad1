"""A batch from its plan to its summary."""

from __future__ import annotations

import glob
import secrets
import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from lfstereo import __version__
from lfstereo.batch.captures import CaptureFile
from lfstereo.batch.crew import Crew, LocalCrew, PairWork, Step
from lfstereo.batch.display import Display
from lfstereo.batch.engine import Engine
from lfstereo.batch.held import camera_key
from lfstereo.batch.jobs import WORK_FOLDER, CameraJob, Outcome, PairJob
from lfstereo.batch.lock import output_lock
from lfstereo.batch.memory import pair_memory_gib
from lfstereo.batch.plan import BatchRequest, Plan, PlannedPair, plan_batch, truth_folder
from lfstereo.batch.record import append, read_record, record_path
from lfstereo.batch.stamps import counted_options, fingerprint
from lfstereo.batch.summary import SummaryRow, write_summary
from lfstereo.batch.work import convert_pair, focus_only, match_only, prepare_camera

PAIR_WORK = PairWork(convert_pair, focus_only, match_only)
_LEFT_BEHIND = (
    "notes/{0}.json",
    "notes/.{0}.json.*",
    f"notes/{{0}}.{'?' * 16}.*.trace",
    f"answers/{{0}}.{'?' * 16}.json",
    f"answers/.{{0}}.{'?' * 16}.json.*",
    "focused/{0}.npz",
    "focused/.{0}.npz.????????.partial",
)
"""What a pair of some name may leave in the work folder; another pair's name may begin with this one's and a dot."""


@dataclass(frozen=True, slots=True)
class BatchReport:
    """What became of a batch."""

    done: int
    """Pairs converted now."""
    kept: int
    """Pairs that were finished before."""
    failed: dict[str, str]
    """Reason of each failed pair, on one line."""
    not_done: tuple[str, ...]
    """Pairs left because the batch had to stop."""
    stopped: str
    """Why it had to; empty if it did not."""
    unreadable: int
    """Captures in no pair because they cannot be read."""

    @property
    def exit_code(self) -> int:
        """0 if everything was converted, 5 if not."""
        return 5 if self.failed or self.not_done or self.unreadable else 0


def run_batch(
    request: BatchRequest, work: PairWork = PAIR_WORK, announce: Callable[[Plan], None] | None = None
) -> BatchReport:
    """Convert all pairs that are not finished; an end of this process at any moment leaves nothing half.

    Parameters
    ----------
    request
        What is to be done.
    work
        Functions that convert a pair.
    announce
        Told the plan before the work begins; without it no progress is shown either.

    Raises
    ------
    InputError
        If the plan cannot be made, see :func:`lfstereo.batch.plan.plan_batch`.
    OutputError
        If another batch holds the output folder, or the record cannot be written.
    """
    plan_batch(request)  # complains before a folder is made
    request.output.mkdir(parents=True, exist_ok=True)
    shard = request.batch.shard_of()
    with output_lock(request.output, shard):
        plan = plan_batch(request)
        _clean(request, plan)
        if announce is not None:
            announce(plan)
        jobs = [_job(pair, request, secrets.token_hex(8)) for pair in plan.to_do]
        outcomes: dict[str, Outcome] = {}
        try:
            stopped = _convert(request, plan, jobs, work, outcomes, announce is None) if jobs else ""
        finally:
            _clean(request, plan)
        return _finish(request, plan, outcomes, stopped)


def _clean(request: BatchRequest, plan: Plan) -> None:
    """Remove what lost workers left of these pairs, in this batch or in one before."""
    output, whole = request.output, request.batch.shard_of()[1] == 1
    names = ["*"] if whole else [glob.escape(pair.files.name) for pair in plan.pairs] + [_camera_name(request, "*")]
    for name in names:
        for scratch in output.glob(f".{name}.????????.partial"):
            shutil.rmtree(scratch, ignore_errors=True)  # a cluster's worker may be writing there still
        for form in _LEFT_BEHIND:
            for leftover in (output / WORK_FOLDER).glob(form.format(name)):
                leftover.unlink(missing_ok=True)


def _job(pair: PlannedPair, request: BatchRequest, token: str) -> PairJob:
    return PairJob(
        name=pair.files.name,
        output=request.output,
        token=token,
        retries=request.batch.retries,
        time_limit_s=request.batch.time_limit_s,
        left=pair.files.left.path,
        right=pair.files.right.path,
        rig=request.rig,
        whites=request.whites,
        options=request.run,
        truth=truth_folder(pair.files, request),
    )


def _convert(
    request: BatchRequest,
    plan: Plan,
    jobs: Sequence[PairJob],
    work: PairWork,
    outcomes: dict[str, Outcome],
    quiet: bool,
) -> str:
    record = record_path(request.output, request.batch.shard_of())
    display = nullcontext() if quiet else Display(len(plan.pairs), len(plan.pairs) - len(jobs))

    def ended(outcome: Outcome) -> None:
        found = ""
        if outcome.state == "done":
            found = fingerprint(outcome.inputs, request.run, outcome.weights_sha256, plan.whites)
        append(record, outcome, found, counted_options(request.run), __version__)
        outcomes[outcome.name] = outcome
        if isinstance(display, Display):
            display.ended(outcome)

    crew = _crew(request, plan, work)
    at_once = True
    try:
        if not quiet:
            print(f"{crew.description}", file=sys.stderr, flush=True)
        cameras = [Step(prepare_camera, crew.steps[0].executor, crew.steps[0].capacity)]
        tick = display.tick if isinstance(display, Display) else lambda _: None
        Engine(crew, cameras, lambda _: None, tick).run(_camera_jobs(request, plan))
        stopped = Engine(crew, crew.steps, ended, tick).run(jobs)
        at_once = bool(stopped)
    finally:
        if isinstance(display, Display):
            display.close()
        crew.close(at_once)
    return stopped


def _crew(request: BatchRequest, plan: Plan, work: PairWork) -> Crew:
    if request.batch.scheduler:
        from lfstereo.batch.cluster import ClusterCrew

        return ClusterCrew(request.batch.scheduler, request.output, work)
    frames = [c.metadata for pair in plan.to_do for c in (pair.files.left, pair.files.right) if c.metadata]
    largest = max((frame.width * frame.height for frame in frames), default=0)
    measured = [entry.outcome.peak_gib for entry in plan.record.entries.values()]
    return LocalCrew(request.batch, pair_memory_gib(largest, measured), work, _has_cuda(request.run.device))


def _has_cuda(device: str) -> bool:
    """Return whether the network can run on a GPU of this machine, without loading torch."""
    return device != "cpu" and Path("/proc/driver/nvidia/version").exists()


def _camera_jobs(request: BatchRequest, plan: Plan) -> list[CameraJob]:
    """Return one job per white image that the pairs need, so that its grid is fitted once."""
    cameras: dict[object, CaptureFile] = {}
    for pair in plan.to_do:
        for capture in (pair.files.left, pair.files.right):
            if capture.metadata is not None:
                cameras.setdefault(camera_key(capture.metadata, request.whites), capture)
    token, batch = secrets.token_hex(8), request.batch
    return [
        CameraJob(
            _camera_name(request, number), request.output, token, 0, batch.time_limit_s, capture.path, request.whites
        )
        for number, capture in enumerate(cameras.values())
    ]


def _camera_name(request: BatchRequest, number: object) -> str:
    part, parts = request.batch.shard_of()
    return f"camera {number} of shard {part}-{parts}"


def _finish(request: BatchRequest, plan: Plan, outcomes: dict[str, Outcome], stopped: str) -> BatchReport:
    entries = read_record(request.output).entries
    rows = []
    for files in plan.pairing.pairs:
        entry = entries.get(files.name)
        rows.append(SummaryRow(files.name, entry.outcome.state if entry else "not done", entry))
    write_summary(request.output, rows, plan.pairing.leftovers)
    failed = {name: outcome.reason for name, outcome in outcomes.items() if outcome.state == "failed"}
    return BatchReport(
        done=sum(outcome.state == "done" for outcome in outcomes.values()),
        kept=len(plan.pairs) - len(plan.to_do),
        failed=failed,
        not_done=tuple(pair.files.name for pair in plan.to_do if pair.files.name not in outcomes),
        stopped=stopped,
        unreadable=sum(len(item.captures) for item in plan.pairing.leftovers if item.kind == "unreadable"),
    )
