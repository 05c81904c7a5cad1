"""The clock of a run."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.progress import StageClock


def test_measures_each_stage_in_order() -> None:
    clock = StageClock()
    with clock.stage("small") as report:
        report(1, 2)
    with clock.stage("large"):
        held = np.ones(2**27, np.uint8)
    assert list(clock.seconds) == list(clock.peak_gib) == ["small", "large"]
    assert clock.peak_gib["large"] > clock.peak_gib["small"] + 0.1
    assert held.all()


def test_draws_a_bar_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    with StageClock(bars=True).stage("decode left") as report:
        report(3, 4)
    err = capsys.readouterr().err
    assert "decode left" in err


def test_a_failed_stage_is_not_counted() -> None:
    clock = StageClock()
    with pytest.raises(KeyError), clock.stage("broken"):
        raise KeyError
    assert clock.seconds == {}
