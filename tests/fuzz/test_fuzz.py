"""The short fuzz run of the suite: every parser against valid files and damage drawn from a fixed seed."""

from __future__ import annotations

import warnings

import pytest

from tests.fuzz.mutate import damaged
from tests.fuzz.targets import RETURNED, TARGETS

EXECUTIONS = {"container": 4000, "metadata": 6000, "archive": 4000, "factory": 4000, "pfm": 4000, "raw": 1500}
"""The cheap ones; others are run 300 times. docs/robustness.md tells how many a long run makes."""


@pytest.mark.parametrize("name", TARGETS)
def test_no_input_breaks_a_parser(name: str) -> None:
    target = TARGETS[name]
    seeds = target.seeds()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a damaged picture may make a decoder warn
        for number, data in enumerate(damaged(seeds, EXECUTIONS.get(name, 300), seed=1)):
            try:
                target.read(data)
            except Exception as error:
                raise AssertionError(f"input {number} of {name}: {data[:400]!r}") from error


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_are_valid(name: str) -> None:
    """Otherwise a fuzz run would never get past the first check."""
    for data in TARGETS[name].seeds():
        RETURNED.clear()
        TARGETS[name].read(data)
        assert RETURNED, f"refused: {data[:200]!r}"
