"""The rig that ships is the one that the simulator sets up by default."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from lfstereo.assets import asset_folder
from lfstereo.rig.rig import read_rig, write_rig
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig


def flat(value: Any) -> list[Any]:
    """Return all numbers and texts of nested tables in their order."""
    if isinstance(value, dict):
        return [part for inner in value.values() for part in flat(inner)]
    return [part for inner in value for part in flat(inner)] if isinstance(value, tuple | list) else [value]


def test_is_what_simulate_writes(tmp_path: Path) -> None:
    write_rig(tmp_path / "rig.toml", build_rig(SimulateOptions()).stereo)
    shipped = asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml"
    names = [line.split("=")[0] for line in shipped.read_text().splitlines()]
    assert names == [line.split("=")[0] for line in (tmp_path / "rig.toml").read_text().splitlines()]
    found, expected = (dataclasses.asdict(read_rig(path)) for path in (shipped, tmp_path / "rig.toml"))
    for a, b in zip(flat(found), flat(expected), strict=True):
        assert a == (pytest.approx(b, rel=1e-13, abs=1e-16) if isinstance(b, float) else b)
