"""White images as cameras leave them: in folders, tar archives and backup volumes."""

from __future__ import annotations

import io
import json
import struct
import tarfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from lfstereo.container import Capture, write_capture
from lfstereo.container.writer import reference, write_container


def put(folder: Path, name: str, capture: Capture, zoom: int = 0, focus: int = 0, **changes: Any) -> None:
    """Write a white image with its text file."""
    folder.mkdir(parents=True, exist_ok=True)
    lens = replace(capture.metadata.lens, zoom_step=zoom, focus_step=focus)
    metadata = replace(capture.metadata, lens=lens, **changes)
    write_capture(folder / f"{name}.RAW", replace(capture, metadata=metadata))


def asked(capture: Capture, zoom: int = 0, focus: int = 0, **changes: Any) -> Any:
    """Return the metadata of a photograph by the camera of a white image."""
    lens = replace(capture.metadata.lens, zoom_step=zoom, focus_step=focus)
    return replace(capture.metadata, lens=lens, is_white_image=False, **changes)


def put_factory_files(folder: Path, serial: str, stems: dict[str, str], hot: list[tuple[int, int]]) -> None:
    """Write the files that stand beside the white images of an Illum; ``stems`` name -> hash."""
    (folder / "unit_info.json").write_text(json.dumps({"camera": {"serialNumber": serial}}))
    files = [{"name": f"{stem}.GCT", "hash": name} for stem, name in stems.items()]
    (folder / "cal_file_manifest.json").write_text(json.dumps({"calibrationFiles": files}))
    columns = [x for x, _ in hot] + [y for _, y in hot]
    (folder / "HOTPIXEL.BIN").write_bytes(struct.pack(f"<I{len(columns)}H", len(hot), *columns))
    lattice = {
        "zoomPosition": [0],
        "numFocusPositions": [1],
        "focusPosition": [[0]],
        "xDiskOriginPixels": [[113.0]],
        "yDiskOriginPixels": [[98.0]],
        "xDiskStepPixelsX": [[14.3]],
        "xDiskStepPixelsY": [[0.02]],
        "yDiskStepPixelsX": [[7.1]],
        "yDiskStepPixelsY": [[12.4]],
    }
    (folder / "mla_calibration.json").write_text(json.dumps(lattice))


def as_tar(folder: Path, target: Path) -> Path:
    """Pack a folder as the Illum's calibration archive: everything below ``unitdata/``."""
    with tarfile.open(target, "w") as archive:
        for path in sorted(folder.iterdir()):
            entry = tarfile.TarInfo(f"unitdata/{path.name}")
            entry.size = path.stat().st_size
            archive.addfile(entry, io.BytesIO(path.read_bytes()))
    return target


def as_volumes(folder: Path, target: Path) -> Path:
    """Pack a folder as the first camera's backup: volumes of two files each in ``C:\\T1CALIB``."""
    target.mkdir(parents=True, exist_ok=True)
    paths = sorted(folder.iterdir())
    pairs = [paths[n : n + 2] for n in range(0, len(paths), 2)]
    for n, pair in enumerate(pairs):
        data = [path.read_bytes() for path in pair]
        files = [
            {"name": f"C:\\T1CALIB\\{path.name}", "dataRef": reference(d)} for path, d in zip(pair, data, strict=True)
        ]
        following = {"nextFile": f"data.C.{n + 1}"} if n + 1 < len(pairs) else {}
        write_container(target / f"data.C.{n}", {"files": files} | following, data, toc_first=True)
    return target


def as_folder(folder: Path, target: Path) -> Path:
    """Leave a folder as it is."""
    del target
    return folder


@pytest.fixture(scope="session")
def camera_files() -> SimpleNamespace:
    """Functions that write what a camera leaves: ``put``, ``put_factory_files``, ``pack[form]``, and ``asked``."""
    pack: dict[str, Callable[[Path, Path], Path]] = {"folder": as_folder, "tar": as_tar, "volumes": as_volumes}
    return SimpleNamespace(put=put, put_factory_files=put_factory_files, pack=pack, asked=asked)


@pytest.fixture(scope="module")
def small_white(draw_frame: Callable[..., Any]) -> Capture:
    """A white image of a few hundred lenslets."""
    capture: Capture = draw_frame(shape=(200, 220)).capture
    return capture
