"""The card of a model: what it is, how it was trained, what it measures, and the sha256 of its weights."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lfstereo.errors import AssetError, ConfigError
from lfstereo.network.families import AnyArchitecture, read_architecture
from lfstereo.options import from_mapping, read_toml, to_toml

LICENCE = "BSD-3-Clause"


@dataclass(frozen=True, slots=True)
class Training:
    """How the weights came about."""

    data: str = ""
    device: str = ""
    minutes: float = 0.0
    """Training time of all stages together; stages may have run side by side."""
    date: str = ""
    stages: tuple[str, ...] = ()
    """One line per stage: recipe, steps, minutes."""


@dataclass(frozen=True, slots=True)
class Metric:
    """One measured figure."""

    name: str
    value: float
    unit: str
    on: str
    """The set it was measured on."""
    command: str
    """What prints it again."""


@dataclass(frozen=True, slots=True)
class ModelCard:
    """A model's ``card.toml``."""

    name: str
    version: int
    licence: str
    sha256: str
    deviations: tuple[str, ...]
    """Where the networks differ from the published description, and why."""
    limits: tuple[str, ...]
    architecture: AnyArchitecture
    training: Training
    metrics: tuple[Metric, ...] = ()


def write_card(card: ModelCard) -> str:
    """Return a card as TOML text."""
    plain = {f.name: getattr(card, f.name) for f in dataclasses.fields(card)}
    tables = {"architecture": plain.pop("architecture"), "training": plain.pop("training")}
    metrics: tuple[Metric, ...] = plain.pop("metrics")
    head = dataclasses.make_dataclass("Head", plain)(**plain)
    text = _wrapped(to_toml(head))
    for name, table in tables.items():
        text += f"\n[{name}]\n" + _wrapped(to_toml(table))
    return text + "".join(f"\n[[metrics]]\n{to_toml(metric)}" for metric in metrics)


def read_card(path: Path) -> ModelCard:
    """Read ``card.toml``.

    Raises
    ------
    AssetError
        If the file is missing, is not TOML, lacks an entry or has an unknown one.
    """
    try:
        table = read_toml(path)
        architecture = read_architecture(table.pop("architecture", {}), f"{path} [architecture]")
        training = from_mapping(Training, table.pop("training", {}), f"{path} [training]")
        rows = table.pop("metrics", [])
        metrics = tuple(
            _complete(Metric, m, f"{path} [[metrics]]") for m in (rows if isinstance(rows, list) else [rows])
        )
        tables = {"architecture": architecture, "training": training, "metrics": metrics}
        card: ModelCard = _complete(ModelCard, table, str(path), tables)
    except ConfigError as error:
        raise AssetError(str(error)) from error
    return card


def _complete(cls: type[Any], table: Any, where: str, given: Mapping[str, Any] | None = None) -> Any:
    if not isinstance(table, dict):
        raise ConfigError(f"{where}: found no table, expected one; take the file from a fresh copy of the model")
    needed = {f.name for f in dataclasses.fields(cls)} - set(given or {})
    if missing := sorted(needed - set(table)):
        raise ConfigError(f"{where}: '{missing[0]}' is missing; take the file from a fresh copy of the model")
    if unknown := sorted(set(table) - needed):
        raise ConfigError(f"{where}: {unknown[0][:60]!r} is unknown; expected {', '.join(sorted(needed))}")
    return from_mapping(cls, table, where, given)


def _wrapped(text: str) -> str:
    """Put each entry of a list of texts on a line of its own."""
    rows = []
    for row in text.splitlines():
        rows.append(row.replace('["', '[\n  "', 1).replace('", "', '",\n  "') if ' = ["' in row else row)
    return "\n".join(rows) + "\n"
