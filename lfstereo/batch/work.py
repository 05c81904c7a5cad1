"""What a worker does: one camera's grid; a pair from captures to result folder, at once or in two steps."""

from __future__ import annotations

import os
from pathlib import Path

from lfstereo.batch.attempts import NotingClock, attempt
from lfstereo.batch.figures import quality_figures, write_thumbnail
from lfstereo.batch.handover import read_focused, write_focused
from lfstereo.batch.held import Held
from lfstereo.batch.jobs import CameraJob, Outcome, PairJob, together
from lfstereo.batch.stamps import result_sha256, stamp
from lfstereo.container import read_capture
from lfstereo.lightfield.calibration import decode_with
from lfstereo.lightfield.field import LightField
from lfstereo.outputs import atomic_folder
from lfstereo.pipeline import (
    CAPTURE_SUFFIXES,
    FocusedPair,
    check_slices,
    focus_pair,
    match_pair,
    open_light_field,
)
from lfstereo.progress import Progress
from lfstereo.results import Inputs, fill_folder, read_truth
from lfstereo.rig.rig import read_rig

_HELD = Held()
"""Of this process; nothing else in lfstereo outlives a call."""


def prepare_camera(job: CameraJob) -> Outcome:
    """Fit a camera's lenslet grid and store it for all workers."""
    return attempt(job, _prepare_camera)


def convert_pair(job: PairJob) -> Outcome:
    """Convert a pair: decode, rectify, stack, network, result folder."""
    return attempt(job, _convert_pair)


def focus_only(job: PairJob) -> Outcome:
    """Do the steps before the network and leave the focal stacks for the worker that has it."""
    return attempt(job, _focus_only)


def match_only(job: PairJob) -> Outcome:
    """Do the network and the result folder for focal stacks that :func:`focus_only` left."""
    return attempt(job, _match_only)


def _prepare_camera(job: CameraJob, clock: NotingClock) -> Outcome:
    with clock.stage("lenslet grid") as progress:
        _HELD.camera(read_capture(job.capture), job.whites, _nobody, progress)
    return Outcome(job.name, "done")


def _convert_pair(job: PairJob, clock: NotingClock) -> Outcome:
    focused, before = _focus(job, clock)
    return together(before, _match(job, focused, clock))


def _focus_only(job: PairJob, clock: NotingClock) -> Outcome:
    focused, outcome = _focus(job, clock)
    with clock.stage("hand over"):
        write_focused(job.focused, focused)
    return outcome


def _match_only(job: PairJob, clock: NotingClock) -> Outcome:
    with clock.stage("take over"):
        focused = read_focused(job.focused, read_rig(job.rig))
    outcome = _match(job, focused, clock)
    job.focused.unlink(missing_ok=True)
    return outcome


def _focus(job: PairJob, clock: NotingClock) -> tuple[FocusedPair, Outcome]:
    rig = read_rig(job.rig)
    warnings: list[str] = []
    inputs = {"left": stamp(job.left), "right": stamp(job.right), "rig": stamp(job.rig)}
    if job.truth is not None:
        inputs["truth"] = stamp(job.truth / "disparity.pfm")

    def opened(path: Path, progress: Progress) -> LightField:
        if path.suffix.lower() not in CAPTURE_SUFFIXES:
            return open_light_field(path, job.whites, progress)
        capture = read_capture(path)
        camera = _HELD.camera(capture, job.whites, warnings.append)
        if camera.white is not None:
            inputs[f"white {'left' if path == job.left else 'right'}"] = camera.white
        return decode_with(capture, camera.calibration, progress=progress)

    focused = focus_pair(job.left, job.right, rig, opened, job.options, clock)
    return focused, Outcome(job.name, "focused", inputs=inputs, warnings=tuple(warnings))


def _match(job: PairJob, focused: FocusedPair, clock: NotingClock) -> Outcome:
    with clock.stage("load network"):
        network = _HELD.network(job.options.model, job.options.device)
        check_slices(job.options, network)
    result = match_pair(focused, network, clock)
    truth = read_truth(job.truth, focused.geometry.size) if job.truth is not None else None
    with atomic_folder(job.folder, force=True) as out:
        report = fill_folder(out, result, Inputs(job.left, job.right, job.rig), job.options, clock, truth)
        with clock.stage("thumbnail"):
            write_thumbnail(out)
        with clock.stage("to disk"):
            _to_disk(out)
        made = result_sha256(out)
        clock.check_not_superseded()
    _to_disk(job.output, deep=False)
    return Outcome(
        job.name,
        "done",
        weights_sha256=network.card.sha256,
        result_sha256=made,
        figures=quality_figures(report, result),
    )


def _nobody(warning: str) -> None:
    """Leave the warning to the pair."""


def _to_disk(folder: Path, deep: bool = True) -> None:
    """Let the files of a folder survive a power cut from here on."""
    inside = sorted(folder.rglob("*")) if deep else []
    for path in (*inside, folder):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
