"""Commands in the guide are commands, its links lead somewhere, and its figures are what their script draws."""

from __future__ import annotations

import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from lfstereo.cli.main import COMMANDS, build_parser

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGES = sorted(DOCS.glob("*.md"))
LINES = [
    (page.name, words)
    for page in PAGES
    for block in re.findall(r"^```\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    for line in block.splitlines()
    if (words := shlex.split(re.split(r" [#>|&]", line)[0]))[:1] == ["lfstereo"]
]


@pytest.mark.parametrize(("page", "words"), LINES, ids=[" ".join(words) for _, words in LINES])
def test_commands_parse(page: str, words: list[str]) -> None:
    assert build_parser(words[1:]).parse_args(words[1:]).command == words[1]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_named_commands_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    for link in re.findall(r"\]\(([^)#]+)", text):
        assert link.startswith("http") or (page.parent / link).exists(), link
    assert set(re.findall(r"`lfstereo ([a-z][a-z-]*)", text)) <= set(COMMANDS)


def test_python_commands_exist() -> None:
    texts = "\n".join(page.read_text("utf-8") for page in PAGES)
    for module in set(re.findall(r"python -m ([\w.]+)", texts)):
        assert importlib.util.find_spec(module), module
    for script in set(re.findall(r"python (\w+/\w+\.py)", texts)):
        assert (DOCS.parent / script).is_file(), script


def test_every_page_is_in_the_list() -> None:
    listed = (DOCS / "README.md").read_text("utf-8")
    assert [page.name for page in PAGES if page.name != "README.md" and f"({page.name})" not in listed] == []


def test_one_page_tells_every_command() -> None:
    assert {words[1] for page, words in LINES if page == "commands.md"} == set(COMMANDS)


def test_figures_are_what_the_script_draws(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(DOCS / "draw_figures.py"), "-o", str(tmp_path)], check=True)
    drawn = {path.name: path.read_text("utf-8") for path in tmp_path.iterdir()}
    assert drawn == {path.name: path.read_text("utf-8") for path in (DOCS / "figures").iterdir()}
