"""What is handed to a worker and what comes back: plain values that any executor can carry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from lfstereo.batch.stamps import FileStamp
from lfstereo.pipeline import RunOptions

WORK_FOLDER = ".batch"
"""Hidden folder in the output: notes and answers of workers, focal stacks on their way."""
State = Literal["done", "focused", "failed"]


@dataclass(frozen=True, slots=True)
class Job:
    """One piece of work, to be done once or recorded as failed."""

    name: str
    output: Path
    """Output folder of the batch, absolute, seen alike by all workers."""
    token: str
    """Of this step of it in this batch; work of an earlier batch that is still running is thrown away."""
    retries: int
    """New attempts after a lost worker."""
    time_limit_s: float

    @property
    def note(self) -> Path:
        """File in which its worker tells what it does."""
        return self.output / WORK_FOLDER / "notes" / f"{self.name}.json"

    @property
    def answer(self) -> Path:
        """File in which its worker leaves what became of it."""
        return self.output / WORK_FOLDER / "answers" / f"{self.name}.{self.token}.json"


@dataclass(frozen=True, slots=True)
class CameraJob(Job):
    """Fit the lenslet grid of one camera before its captures come."""

    capture: Path
    whites: Path | None


@dataclass(frozen=True, slots=True)
class PairJob(Job):
    """Convert one pair."""

    left: Path
    right: Path
    rig: Path
    whites: Path | None
    options: RunOptions
    truth: Path | None = None

    @property
    def folder(self) -> Path:
        """The pair's result folder."""
        return self.output / self.name

    @property
    def focused(self) -> Path:
        """File that carries its focal stacks from one worker to another."""
        return self.output / WORK_FOLDER / "focused" / f"{self.name}.npz"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a job."""

    name: str
    state: State
    reason: str = ""
    """Of a failure, on one line."""
    kind: str = ""
    """Class of the error."""
    inputs: dict[str, FileStamp] = field(default_factory=dict)
    """Files that the result was made from, by role."""
    weights_sha256: str = ""
    result_sha256: str = ""
    """Of the run.toml in the result folder, by which this conversion is told from every other."""
    warnings: tuple[str, ...] = ()
    """What the user must know of a result, one line each."""
    figures: dict[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    peak_gib: float = 0.0
    attempt: int = 1
    workers: tuple[str, ...] = ()
    """``host:process`` of each step."""


def values_of(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome as plain values, those that are empty left out."""
    return {name: value for name, value in asdict(outcome).items() if value}


def outcome_from(values: Mapping[str, Any]) -> Outcome:
    """Return the outcome of which :func:`values_of` gave the values; others among them are passed over.

    Raises
    ------
    KeyError, TypeError, AttributeError
        If they are of something else.
    """
    known = {name: values[name] for name in Outcome.__dataclass_fields__ if name in values}
    known["inputs"] = {role: FileStamp(**stamp) for role, stamp in values.get("inputs", {}).items()}
    lists = {name: tuple(values.get(name, ())) for name in ("warnings", "workers")}
    return Outcome(**known | lists)


def together(first: Outcome | None, last: Outcome) -> Outcome:
    """Return the outcome of a pair over two of its steps."""
    if first is None:
        return last
    return replace(
        last,
        inputs=first.inputs | last.inputs,
        warnings=(*first.warnings, *last.warnings),
        seconds=first.seconds | last.seconds,
        peak_gib=max(first.peak_gib, last.peak_gib),
        attempt=max(first.attempt, last.attempt),
        workers=(*first.workers, *last.workers),
    )


Work: TypeAlias = Callable[[PairJob], Outcome]
