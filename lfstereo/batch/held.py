"""What a worker keeps from one pair to the next: networks, and the grid and shading of its cameras."""

from __future__ import annotations

import hashlib
import json
from collections import OrderedDict
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lfstereo import __version__
from lfstereo.arrays import Float32
from lfstereo.batch.jobs import WORK_FOLDER
from lfstereo.batch.stamps import FileStamp, stamp
from lfstereo.container import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.develop.shading import shading_from_white_image
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.white import find_white_image
from lfstereo.lightfield.decoding import calibrate
from lfstereo.outputs import atomic_file
from lfstereo.progress import Progress, silent

if TYPE_CHECKING:
    from lfstereo.network.estimate import Network

_CAMERAS_HELD = 2
"""The left and the right one; more would cost 170 MB each."""
_CameraKey = tuple[Path, str, int, int, int, int]


@dataclass(frozen=True, slots=True)
class HeldCamera:
    """A white image, made into what the decode needs."""

    white: FileStamp
    grid: LensletGrid
    shading: Float32
    """``(H, W)`` relative illumination, 1 = full light."""


@dataclass(frozen=True, slots=True)
class Held:
    """Of one worker process."""

    networks: dict[tuple[str, str], Network] = field(default_factory=dict)
    cameras: OrderedDict[_CameraKey, HeldCamera] = field(default_factory=OrderedDict)

    def network(self, model: str, device: Literal["auto", "cpu", "cuda"]) -> Network:
        """Return a network, loaded once."""
        if (model, device) not in self.networks:
            from lfstereo.network.estimate import load_network

            self.networks[model, device] = load_network(model, device)
        return self.networks[model, device]

    def camera(self, capture: Capture, whites: Path, output: Path, progress: Progress = silent) -> HeldCamera:
        """Return grid and shading for a capture; the grid of a white image is fitted once in a batch."""
        key = camera_key(capture.metadata, whites)
        if key not in self.cameras:
            while len(self.cameras) >= _CAMERAS_HELD:
                self.cameras.popitem(last=False)
            self.cameras[key] = _prepared(capture, whites, output, progress)
        self.cameras.move_to_end(key)
        return self.cameras[key]


def camera_key(metadata: FrameMetadata, whites: Path) -> _CameraKey:
    """Return what decides which white image belongs to a capture."""
    lens = metadata.lens
    return whites, metadata.serial, metadata.width, metadata.height, lens.zoom_step, lens.focus_step


def _prepared(capture: Capture, whites: Path, output: Path, progress: Progress) -> HeldCamera:
    white = find_white_image(whites, capture.metadata)
    found = stamp(Path(white.source))
    options = GridOptions()
    made_with = f"{found.sha256} {options} {__version__}"
    stored = output / WORK_FOLDER / "grids" / f"{hashlib.sha256(made_with.encode()).hexdigest()[:24]}.json"
    grid = _read_grid(stored)
    if grid is not None:
        return HeldCamera(found, grid, shading_from_white_image(white))
    grid, shading = calibrate(capture, white, options, progress)
    stored.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(stored, force=True) as scratch:
        scratch.write_text(json.dumps(asdict(grid)), "utf-8")
    return HeldCamera(found, grid, shading)


def _read_grid(path: Path) -> LensletGrid | None:
    try:
        values = json.loads(path.read_text("utf-8"))
        return LensletGrid(**{name: tuple(v) if isinstance(v, list) else v for name, v in values.items()})
    except (OSError, ValueError, TypeError):
        return None
