"""README's commands are commands, and its Python runs."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lfstereo.cli.main import COMMANDS, build_parser, main

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
SHELL_LINES = [
    line.split("  #")[0].strip() for language, block in BLOCKS if not language for line in block.splitlines()
]
PROGRAM_LINES = [line for line in SHELL_LINES if line.startswith("lfstereo ")]


def test_tells_the_three_jobs() -> None:
    assert {"run", "calibrate", "batch", "demo", "doctor"} <= {shlex.split(line)[1] for line in PROGRAM_LINES}


def test_measuring_commands_exist() -> None:
    """Every figure names the command that gives it."""
    rows = [line for line in README.splitlines() if line.startswith("|") and "---" not in line]
    told = [row.split("|")[-2] for row in rows if not row.startswith("| what |")]
    assert len(told) > 10
    for words in re.findall(r"`([^`]+)`", " ".join(told)):
        program, named, *_ = words.split()
        assert program in ("make", "python", "lfstereo"), words
        if program == "python":
            assert (ROOT / named).is_file(), words
        if program == "lfstereo":
            assert named in COMMANDS, words


@pytest.mark.parametrize("line", PROGRAM_LINES)
def test_commands_parse(line: str) -> None:
    words = shlex.split(line)[1:]
    assert build_parser(words).parse_args(words).command == words[0]


def test_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    targets = [line.split()[1] for line in SHELL_LINES if line.startswith("make ")]
    assert targets[:2] == ["demo", "test"]
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_linked_files_exist() -> None:
    for link in re.findall(r"\]\(([^)#]+)\)", README):
        assert link.startswith("http") or (ROOT / link).exists(), link


def test_python_runs(tmp_path: Path) -> None:
    pair = tmp_path / "pair"
    assert main(["simulate", "-o", str(pair), "--sensor", "small"]) == 0
    shutil.copy(pair / "left.LFR", tmp_path / "IMG_0042.LFR")
    shutil.move(pair / "whites", tmp_path / "WHITES")
    (code,) = (block for language, block in BLOCKS if language == "python")
    check = "assert slices.shape == (3, 87, 125, 3), slices.shape"
    subprocess.run([sys.executable, "-W", "error", "-c", f"{code}\n{check}"], cwd=tmp_path, check=True)
