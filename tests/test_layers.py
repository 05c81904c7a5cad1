"""No package imports a later one, and torch stays where it belongs."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import lfstereo

PACKAGE = Path(lfstereo.__file__).parent
LAYERS = [
    ["errors", "conventions", "arrays", "options", "assets", "outputs", "progress"],
    ["container"],
    ["lenslet"],
    ["develop"],
    ["lightfield"],
    ["rig"],
    ["focus"],
    ["depth"],
    ["simulate"],
    ["network"],
    ["training"],
    ["pipeline", "results", "stack_pipeline", "stack_results", "batch", "viewer", "doctor"],
    ["cli", "__main__", "__init__"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
TORCH_PACKAGES = {"network", "training"}
MODULES = sorted(PACKAGE.rglob("*.py"))


def imported_names(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names.add(node.module or "")
    return names


@pytest.mark.parametrize("module", MODULES, ids=lambda m: str(m.relative_to(PACKAGE)))
def test_imports_only_what_comes_before(module: Path) -> None:
    own = module.relative_to(PACKAGE).with_suffix("").parts[0]
    assert own in RANK, f"{own} has no place among the layers"
    names = imported_names(ast.parse(module.read_text("utf-8")))
    for name in names:
        parts = name.split(".")
        if parts[0] == "lfstereo" and len(parts) > 1:
            assert RANK[parts[1]] <= RANK[own], f"{own} imports {name}, which comes later"
        if parts[0] == "torch":
            assert own in TORCH_PACKAGES, f"{own} imports torch"


def test_every_file_is_short_enough_to_read() -> None:
    long = {str(m.relative_to(PACKAGE)): n for m in MODULES if (n := len(m.read_text("utf-8").splitlines())) > 400}
    assert not long


def loaded_by(code: str) -> set[str]:
    out = subprocess.run(
        [sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return {name.split(".")[0] for name in out.stdout.split()}


def test_help_and_import_load_neither_numpy_nor_torch() -> None:
    assert loaded_by("import lfstereo").isdisjoint({"numpy", "torch", "cv2"})
    assert loaded_by("from lfstereo.cli.main import build_parser; build_parser([])").isdisjoint(
        {"numpy", "torch", "cv2"}
    )
