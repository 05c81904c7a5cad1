"""How many workers fit."""

from __future__ import annotations

import pytest

from lfstereo.batch.memory import fitting_workers, free_memory_gib, pair_memory_gib, usable_cores


def test_measured_peaks_count_more_than_the_formula() -> None:
    assert pair_memory_gib(7728 * 5368, [2.0, 1.5, 0.0]) == pytest.approx(2.2)
    assert pair_memory_gib(0, []) < pair_memory_gib(7728 * 5368, [])


def test_one_worker_at_least_and_one_per_core_at_most() -> None:
    assert [fitting_workers(2.0, free, 4) for free in (0.1, 4.5, 9.0, 100.0)] == [1, 2, 4, 4]


def test_this_machine() -> None:
    assert 0 < free_memory_gib() < 1e5
    assert usable_cores() >= 1
