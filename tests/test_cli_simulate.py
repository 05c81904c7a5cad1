"""``lfstereo simulate`` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lfstereo.cli.main import main

QUICK = ["--sensor", "small", "--samples", "1"]


def test_writes_a_session_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "run.toml"
    config.write_text("[simulate]\nseed = 5\nnoise = false\n", "utf-8")
    out = tmp_path / "pair"
    assert main(["simulate", "-o", str(out), "--config", str(config), "--json", *QUICK]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["sensor_px"] == [1546, 1074]
    written = (out / "simulation.toml").read_text("utf-8")
    assert "seed = 5" in written
    assert "noise = false" in written
    assert (out / "truth" / "disparity.pfm").is_file()
    assert main(["simulate", "-o", str(out), *QUICK]) == 3
    assert "exists already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--near-m", "2"], "far_m = 1.2, expected more than near_m = 2.0; correct the option"),
        (["--boards", "1", "--board-square-m", "0.2"], "does not fit into both views"),
    ],
)
def test_bad_options_are_one_line(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "-o", str(tmp_path / "out"), *QUICK, *words]) == 3
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
