"""``lfstereo demo`` and ``lfstereo completion`` from the command line."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from lfstereo.cli.demo import demo_commands
from lfstereo.cli.main import COMMANDS, build_parser, main


def test_demo_goes_from_nothing_to_depth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "demo"
    assert main(["demo", "-o", str(out), "--sensor", "small"]) == 0
    told = capsys.readouterr()
    assert "error against truth" in told.out
    assert [line.split()[2] for line in told.err.splitlines() if line.startswith("$ ")] == ["simulate", "run"]
    assert (out / "result" / "report.html").is_file()
    assert main(["demo", "-o", str(out), "--sensor", "small"]) == 3
    assert "exists already" in capsys.readouterr().err


def test_demo_starts_commands_that_exist_at_every_size() -> None:
    sizes = build_parser(["demo"]).parse_args(["demo"]).sensor, "small"
    for sensor in sizes:
        for words in demo_commands(Path("demo"), sensor, force=True):
            assert build_parser(words).parse_args(words).command == words[0]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "tcsh"])
def test_completion_knows_every_command(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert [name for name in COMMANDS if name not in script] == []
    assert "temperature" in script  # an option of one command
    if shell == "bash" and shutil.which("bash"):
        ask = 'COMP_WORDS=(lfstereo si); COMP_CWORD=1; _shtab_lfstereo; echo "${COMPREPLY[@]}"'
        told = subprocess.run(["bash", "-c", f"{script}\n{ask}"], capture_output=True, text=True, check=True)
        assert told.stdout.split() == ["simulate"]
