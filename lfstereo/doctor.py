"""Check an installation: versions, weights, folders, memory, graphics card; and say what to do."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lfstereo.assets import asset_folder
from lfstereo.errors import LfstereoError
from lfstereo.network.shipped import CARD, WEIGHTS
from lfstereo.options import read_toml

PYTHON_AT_LEAST = (3, 11)
MEMORY_GIB = 3.0
"""What a run at full sensor size needs: 2.1 GiB at its peak, and the system beside it."""
DISK_GIB = 2.0
"""What two captures, their white images and one result folder take, with room to spare."""
_REINSTALL = "run 'pip install --upgrade --force-reinstall lfstereo'"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    name: str
    state: Literal["ok", "advice", "wrong"]
    """``wrong``: lfstereo will not work; ``advice``: it works, with less."""
    found: str
    to_do: str = ""


def check_installation(output: Path) -> list[Finding]:
    """Look at everything that lfstereo needs.

    Parameters
    ----------
    output
        Folder that results would be written to; its disk is looked at.
    """
    checks: tuple[Callable[[], list[Finding]], ...] = (
        check_python,
        check_packages,
        check_weights,
        check_cache,
        check_graphics_card,
        check_ffmpeg,
        check_memory,
        lambda: check_disk(output),
    )
    return [finding for check in checks for finding in check()]


def check_python() -> list[Finding]:
    """Compare the version of Python with the oldest that will do."""
    if tuple(map(int, platform.python_version_tuple()[:2])) >= PYTHON_AT_LEAST:
        return [Finding("python", "ok", platform.python_version())]
    wanted = ".".join(map(str, PYTHON_AT_LEAST))
    return [Finding("python", "wrong", platform.python_version(), f"install Python {wanted} or newer")]


def check_packages() -> list[Finding]:
    """Compare the version of every package with the range that lfstereo declares."""
    try:
        from packaging.requirements import Requirement

        needed = importlib.metadata.requires("lfstereo") or []
    except importlib.metadata.PackageNotFoundError:
        return [Finding("packages", "wrong", "lfstereo is not installed", "run 'pip install .' beside pyproject.toml")]
    except ImportError as error:
        return [Finding("packages", "wrong", str(error), "run 'pip install packaging'")]
    findings = []
    for line in needed:
        requirement = Requirement(line)
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        to_do = f"run 'pip install \"{requirement.name}{requirement.specifier}\"'"
        try:
            version = importlib.metadata.version(requirement.name)
        except importlib.metadata.PackageNotFoundError:
            findings.append(Finding(requirement.name, "wrong", "not installed", to_do))
            continue
        if requirement.specifier.contains(version, prereleases=True):
            findings.append(Finding(requirement.name, "ok", version))
        else:
            findings.append(Finding(requirement.name, "wrong", f"{version}, not {requirement.specifier}", to_do))
    return findings


def check_weights() -> list[Finding]:
    """Compare the weights of every shipped model with the sha256 of its card."""
    try:
        cards = sorted(asset_folder("models").glob(f"*/{CARD}"))
    except LfstereoError as error:
        return [Finding("weights", "wrong", str(error), _REINSTALL)]
    if not cards:
        return [Finding("weights", "wrong", "no model is shipped", _REINSTALL)]
    findings = []
    for card in cards:
        name, weights = f"weights {card.parent.name}", card.parent / WEIGHTS
        try:
            expected = str(read_toml(card).get("sha256"))
            found = hashlib.sha256(weights.read_bytes()).hexdigest()
        except (LfstereoError, OSError) as error:
            findings.append(Finding(name, "wrong", str(error), _REINSTALL))
            continue
        if found == expected:
            findings.append(Finding(name, "ok", f"sha256 {found[:12]}"))
        else:
            findings.append(Finding(name, "wrong", f"sha256 {found[:12]}, not {expected[:12]}", _REINSTALL))
    return findings


def check_cache() -> list[Finding]:
    """Try to write where grids and white images are kept."""
    try:
        from lfstereo.lenslet.home import HOME_VARIABLE, cache_folder, library_folder
    except ImportError as error:
        return [Finding("cache", "wrong", str(error), _REINSTALL)]
    findings = []
    for name, folder in (("cache", cache_folder()), ("white images", library_folder())):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                findings.append(Finding(name, "ok", str(folder)))
        except OSError as error:
            to_do = f"name a folder that can be written by {HOME_VARIABLE}; else grids are fitted anew every time"
            findings.append(Finding(name, "advice", f"{folder}: {error.strerror}", to_do))
    return findings


def check_graphics_card() -> list[Finding]:
    """Ask torch for a graphics card."""
    try:
        from lfstereo.network.device_check import graphics_card

        card = graphics_card()
    except (ImportError, OSError, RuntimeError) as error:
        return [Finding("graphics card", "wrong", f"torch fails: {str(error).splitlines()[0]}", "install torch again")]
    if card:
        return [Finding("graphics card", "ok", card)]
    return [Finding("graphics card", "ok", "none found; the processor does everything, only training is slow")]


def check_ffmpeg() -> list[Finding]:
    """Look for the ffmpeg that writes MP4 files."""
    try:
        import imageio_ffmpeg

        return [Finding("ffmpeg", "ok", imageio_ffmpeg.get_ffmpeg_exe())]
    except (ImportError, RuntimeError):
        to_do = "run 'pip install imageio-ffmpeg', or write .gif instead of .mp4"
        return [Finding("ffmpeg", "advice", "not found", to_do)]


def check_memory() -> list[Finding]:
    """Compare the memory that is free with what a run at full sensor size needs."""
    free = _available_bytes()
    if free == 0:
        return [Finding("memory", "ok", "this system does not tell")]
    return [_room("memory", free, MEMORY_GIB, "close other programs")]


def check_disk(output: Path) -> list[Finding]:
    """Compare the disk space that is free with what a demo takes."""
    folder = output.resolve()
    while not folder.is_dir():
        folder = folder.parent
    return [_room("disk", shutil.disk_usage(folder).free, DISK_GIB, f"make room on the disk of {folder}")]


def _room(name: str, free_bytes: int, needed_gib: float, to_do: str) -> Finding:
    free = free_bytes / 2**30
    if free >= needed_gib:
        return Finding(name, "ok", f"{free:.1f} GiB free")
    return Finding(name, "advice", f"{free:.1f} GiB free, {needed_gib:.0f} wanted", to_do)


def _available_bytes() -> int:
    """Return what Linux would give without swapping: free memory and caches; 0 where there is no such figure."""
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:")), 0)
