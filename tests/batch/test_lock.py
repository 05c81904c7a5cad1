"""Who may write into an output folder beside whom."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfstereo.batch.lock import output_lock
from lfstereo.batch.options import BatchOptions
from lfstereo.errors import ConfigError, OutputError


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ((1, 1), (1, 1), "another batch, process"),
        ((1, 1), (1, 2), "another batch, process"),
        ((1, 2), (1, 1), "a batch of 2 shards"),
        ((1, 2), (1, 3), "the same n"),
        ((1, 2), (1, 2), "does shard 1/2 already"),
    ],
)
def test_refused(tmp_path: Path, first: tuple[int, int], second: tuple[int, int], message: str) -> None:
    with output_lock(tmp_path, first):
        with pytest.raises(OutputError, match=message), output_lock(tmp_path, second):
            pass
        with pytest.raises(OutputError), output_lock(tmp_path, second):
            pass
    with output_lock(tmp_path, second):
        pass


def test_shards_beside_each_other(tmp_path: Path) -> None:
    with output_lock(tmp_path, (1, 3)), output_lock(tmp_path, (3, 3)), output_lock(tmp_path, (2, 3)):
        pass


@pytest.mark.parametrize("shard", ["2", "0/3", "4/3", "a/b", "1/2/3"])
def test_shard_that_is_none(shard: str) -> None:
    with pytest.raises(ConfigError, match="i/n"):
        BatchOptions(shard=shard)


@pytest.mark.parametrize(
    "option",
    [{"retries": -1}, {"workers": -1}, {"time_limit_s": 0.0}, {"clock_tolerance_s": 0.0}, {"network_workers": -2}],
)
def test_options_that_cannot_be(option: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(option))):
        BatchOptions(**option)  # type: ignore[arg-type]
