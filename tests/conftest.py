"""Shared by all tests: where real data lies, if anywhere."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real photographs and references; the test is skipped where none is named."""
    named = os.environ.get("LFSTEREO_DATA", "")
    if not named:
        pytest.skip("LFSTEREO_DATA names no folder of real captures (see CONTRIBUTING.md)")
    folder = Path(named)
    assert folder.is_dir(), f"LFSTEREO_DATA={named} is no folder"
    return folder
