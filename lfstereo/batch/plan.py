"""What a batch is going to do: its pairs, which of them are finished, and what is left over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lfstereo.batch.captures import list_captures
from lfstereo.batch.figures import THUMBNAIL
from lfstereo.batch.options import BatchOptions
from lfstereo.batch.pairing import PairFiles, Pairing, pair_captures
from lfstereo.batch.record import Entry, Record, read_record
from lfstereo.batch.stamps import (
    FileStamp,
    counted_options,
    fingerprint,
    model_sha256,
    result_sha256,
    stamp,
    white_listing,
)
from lfstereo.errors import AssetError, InputError, OutputError
from lfstereo.pipeline import RunOptions
from lfstereo.rig.rig import read_rig


@dataclass(frozen=True, slots=True)
class BatchRequest:
    """What the user asked for; all paths absolute."""

    captures: Path
    rig: Path
    whites: Path | None
    output: Path
    run: RunOptions
    batch: BatchOptions


@dataclass(frozen=True, slots=True)
class PlannedPair:
    """One pair and what is known of its result."""

    files: PairFiles
    finished: bool
    why: str
    """Why it is to be converted; empty for a finished one."""


@dataclass(frozen=True, slots=True)
class Plan:
    """All pairs of a batch, or of its shard."""

    pairing: Pairing
    pairs: tuple[PlannedPair, ...]
    """Of this shard."""
    record: Record
    weights_sha256: str
    whites: str
    """Listing of the white images, see :func:`lfstereo.batch.stamps.white_listing`."""

    @property
    def to_do(self) -> tuple[PlannedPair, ...]:
        """Pairs that are not finished."""
        return tuple(pair for pair in self.pairs if not pair.finished)


def plan_batch(request: BatchRequest) -> Plan:
    """Pair the captures and compare with what is finished; nothing is written.

    Raises
    ------
    InputError
        If the folder, the rig, the model or the white images cannot be used, or no pair is found.
    OutputError
        If a pair's result folder would replace something that is no result of a batch.
    """
    rig = read_rig(request.rig)
    if request.whites is not None and not request.whites.exists():
        raise AssetError(f"{request.whites}: found no such folder, expected the cameras' white images; check the path")
    skip = [request.output, *([request.whites] if request.whites else [])]
    captures = list_captures(request.captures, skip)
    pairing = pair_captures(captures, rig, request.batch)
    if not pairing.pairs:
        reasons = "; ".join(f"{item.captures[0].place}: {item.reason}" for item in pairing.leftovers[:3])
        raise InputError(
            f"{request.captures}: found {len(captures)} captures and no pair by {pairing.way}"
            f"{f' ({reasons})' if reasons else ''}; choose another way with --pair-by"
        )
    plan = Plan(
        pairing, (), read_record(request.output), model_sha256(request.run.model), white_listing(request.whites)
    )
    part, parts = request.batch.shard_of()
    pairs = tuple(_planned(files, request, plan) for files in pairing.pairs[part - 1 :: parts])
    return Plan(pairing, pairs, plan.record, plan.weights_sha256, plan.whites)


def truth_folder(files: PairFiles, request: BatchRequest) -> Path | None:
    """Return the folder with a pair's true disparity, if the user named one and it is there."""
    if not request.batch.truth:
        return None
    folder = files.left.path.parent / request.batch.truth
    return folder if folder.is_dir() else None


def _planned(files: PairFiles, request: BatchRequest, plan: Plan) -> PlannedPair:
    folder = request.output / files.name
    entry = plan.record.entries.get(files.name)
    ours = folder.is_dir() and (folder / THUMBNAIL).is_file()
    if folder.exists() and not ours:
        raise OutputError(f"{folder}: exists and is no result of a batch; give another output path")
    if entry is None:
        return PlannedPair(files, False, "new" if not ours else "its record is missing")
    if entry.outcome.state != "done":
        return PlannedPair(files, False, f"failed before: {entry.outcome.reason}")
    why = _no_result(folder, entry) or _changed(files, request, plan, entry)
    return PlannedPair(files, not why, why)


def _no_result(folder: Path, entry: Entry) -> str:
    """Return why a folder is not the result that the record speaks of; empty if it is.

    A batch that is killed between the two leaves a result that the record does not know.
    """
    if not (folder / THUMBNAIL).is_file():
        return "its result is gone"
    made = entry.outcome.result_sha256
    return "" if not made or result_sha256(folder) == made else "its result is not the recorded one"


def _changed(files: PairFiles, request: BatchRequest, plan: Plan, entry: Entry) -> str:
    """Return what differs from the recorded result; empty if nothing does."""
    before = entry.outcome.inputs
    paths = {"left": files.left.path, "right": files.right.path, "rig": request.rig}
    truth = truth_folder(files, request)
    if truth is not None:
        paths["truth"] = truth / "disparity.pfm"
    try:
        now = {role: stamp(path, before.get(role)) for role, path in paths.items()}
        now |= {role: _white_now(known, request.whites) for role, known in before.items() if role.startswith("white")}
    except OSError as error:
        return f"{error.filename} is gone"
    if fingerprint(now, request.run, plan.weights_sha256, plan.whites) == entry.fingerprint:
        return ""
    return _difference(before, now, request, plan, entry)


def _white_now(known: FileStamp, whites: Path | None) -> FileStamp:
    path = Path(known.path)
    if path.exists() or whites is None:
        return stamp(path, known)
    moved = next((found for file in whites.rglob(path.name) if (found := stamp(file)).sha256 == known.sha256), None)
    return moved or stamp(path, known)


def _difference(
    before: Mapping[str, FileStamp], now: Mapping[str, FileStamp], request: BatchRequest, plan: Plan, entry: Entry
) -> str:
    for role in sorted({*before, *now}):
        if role not in before or role not in now or before[role].sha256 != now[role].sha256:
            return f"{role} changed"
    options = counted_options(request.run)
    for name in sorted({*options, *entry.options}):
        if options.get(name) != entry.options.get(name):
            return f"option {name} changed"
    if entry.outcome.weights_sha256 != plan.weights_sha256:
        return "weights changed"
    return "white images were added or removed"
