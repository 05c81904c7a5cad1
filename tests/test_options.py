"""Options: one dataclass is the default, the TOML table and the command line."""

from __future__ import annotations

import argparse
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments, from_mapping, option, read_toml, to_toml, toml_value


@dataclass(frozen=True, slots=True)
class Sample:
    count: int = option(3, "how many", "px")
    ratio: float = option(0.5, "how much")
    name: str = option("a", "which")
    keep: bool = option(True, "whether")
    place: Path | None = option(None, "where")
    method: Literal["fast", "exact"] = option("fast", "how")
    size: tuple[int, int] = option((1, 2), "extent")
    slopes: tuple[float, ...] = option((0.1,), "several")


def parsed(*words: str, table: dict[str, object] | None = None) -> Sample:
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_arguments(parser, Sample)
    return from_arguments(Sample, parser.parse_args(list(words)), table, "run.toml")


def test_defaults_need_nothing() -> None:
    assert parsed() == Sample()


def test_command_line_wins_over_file_wins_over_default() -> None:
    result = parsed("--count", "5", "--no-keep", "--size", "7", "8", table={"count": 4, "ratio": 2})
    assert (result.count, result.ratio, result.keep, result.size) == (5, 2.0, False, (7, 8))


def test_toml_round_trip() -> None:
    value = Sample(name='q"\\\nü', place=Path("a b"), slopes=(1.0, -2.5), method="exact")
    assert from_mapping(Sample, tomllib.loads(to_toml(value)), "x") == value


def test_toml_value_of_a_path_with_a_tab() -> None:
    text = toml_value("a\tb")
    assert tomllib.loads(f"v = {text}") == {"v": "a\tb"}


def test_toml_value_of_numpy_numbers() -> None:
    assert toml_value((np.float64(0.5), True)) == "[0.5, true]"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"cuont": 1}, "'cuont' is not an option; known are count"),
        ({"count": "x"}, "count = 'x' does not fit"),
        ({"count": 1.5}, "expected a whole number"),
        ({"count": True}, "found true/false"),
        ({"keep": "perhaps"}, "expected true or false"),
        ({"method": "slow"}, "expected one of fast, exact"),
        ({"size": [1]}, "expected 2 values, found 1"),
        ({"size": 3}, "expected a list"),
        ({"name": 5}, "expected text"),
        ({"ratio": None}, "a value is needed"),
    ],
)
def test_says_what_is_wrong(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        from_mapping(Sample, values, "run.toml [sample]")
    assert "run.toml [sample]" in str(caught.value)


def test_broken_toml_and_missing_file(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    with pytest.raises(ConfigError, match="cannot be read"):
        read_toml(path)
    path.write_text("a = ")
    with pytest.raises(ConfigError, match="not valid TOML"):
        read_toml(path)
