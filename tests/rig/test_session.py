"""One camera's photographs of a session are decoded with one lenslet grid, as long as it fits."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from lfstereo.errors import GridFitError
from lfstereo.rig import session
from lfstereo.rig.session import ShotSide


def decoded_with(monkeypatch: pytest.MonkeyPatch, offsets_px: list[float | None]) -> list[int]:
    """Decode a shot more than there are offsets; return which shot chose the grid that each was decoded with."""
    chosen: list[int] = []
    left = iter(offsets_px)

    def choose(capture: Any, whites: Path) -> SimpleNamespace:
        assert whites == Path("whites")
        chosen.append(capture.number)
        return SimpleNamespace(grid=capture.number)

    def drift(*_: object) -> SimpleNamespace:
        offset = next(left)
        if offset is None:
            raise GridFitError("too dark")
        return SimpleNamespace(offset_px=offset)

    monkeypatch.setattr(session, "calibrate_photograph", choose)
    monkeypatch.setattr(session, "measure_drift", drift)
    monkeypatch.setattr(session, "decode_with", lambda _, lenslets: lenslets.grid)
    side = ShotSide("left", Path("whites"))
    return [side._decoded(SimpleNamespace(number=n)) for n in range(len(offsets_px) + 1)]  # type: ignore[arg-type, misc]


def test_the_grid_chosen_for_the_first_shot_serves_all_that_it_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    assert decoded_with(monkeypatch, [0.02, 0.1, 0.05]) == [0, 0, 0, 0]


@pytest.mark.parametrize("offset_px", [0.8, None])
def test_a_shot_that_it_does_not_fit_chooses_anew(monkeypatch: pytest.MonkeyPatch, offset_px: float | None) -> None:
    assert decoded_with(monkeypatch, [0.02, offset_px, 0.03]) == [0, 0, 2, 2]
