"""What a worker keeps from one pair to the next: networks, and what its cameras' captures are decoded with."""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lfstereo.batch.stamps import FileStamp, stamp
from lfstereo.container import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.errors import GridFitError
from lfstereo.lenslet.drift import measure_drift
from lfstereo.lenslet.options import GridOptions
from lfstereo.lightfield.calibration import LensletCalibration, calibrate_photograph
from lfstereo.progress import Progress, silent

if TYPE_CHECKING:
    from lfstereo.network.estimate import Network

_CAMERAS_HELD = 2
"""The left and the right one; more would cost 170 MB each."""


@dataclass(frozen=True, slots=True)
class HeldCamera:
    """What captures of one camera at one zoom and focus are decoded with."""

    calibration: LensletCalibration
    """Without the white image itself, of which nothing more is needed."""
    white: FileStamp | None
    """The white image's file; ``None`` where the photograph had to do, or where it lies in an archive."""


@dataclass(frozen=True, slots=True)
class Held:
    """Of one worker process."""

    networks: dict[tuple[str, str], Network] = field(default_factory=dict)
    cameras: OrderedDict[object, HeldCamera] = field(default_factory=OrderedDict)

    def network(self, model: str, device: Literal["auto", "cpu", "cuda"]) -> Network:
        """Return a network, loaded once."""
        if (model, device) not in self.networks:
            from lfstereo.network.estimate import load_network

            self.networks[model, device] = load_network(model, device)
        return self.networks[model, device]

    def camera(
        self, capture: Capture, whites: Path | None, warn: Callable[[str], None], progress: Progress = silent
    ) -> HeldCamera:
        """Return what to decode a capture with: what served the camera before, if it fits this capture too.

        Parameters
        ----------
        capture
            The photograph; its own micro-images decide whether a grid fits.
        whites
            As in `lfstereo.lightfield.calibration.calibrate_photograph`.
        warn
            Told what the user must know of the grid.
        progress
            Told of the work done.
        """
        key, options = camera_key(capture.metadata, whites), GridOptions()
        known = self.cameras.get(key)
        if known is not None and _fits(known, capture, options):
            self.cameras.move_to_end(key)
            return known
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = calibrate_photograph(capture, whites, options, progress)
        for warning in caught:
            warn(str(warning.message))
        file = Path(found.white.source) if found.white else None
        camera = HeldCamera(replace(found, white=None), stamp(file) if file and file.is_file() else None)
        if found.white is not None:
            while len(self.cameras) >= _CAMERAS_HELD:
                self.cameras.popitem(last=False)
            self.cameras[key] = camera
        return camera


def camera_key(metadata: FrameMetadata, whites: Path | None) -> object:
    """Return what decides which white image belongs to a capture."""
    lens = metadata.lens
    size = metadata.width, metadata.height
    return whites, metadata.serial, size, lens.zoom_step, lens.focus_step, metadata.geometry_ref


def _fits(camera: HeldCamera, capture: Capture, options: GridOptions) -> bool:
    try:
        drift = measure_drift(capture, camera.calibration.grid, options)
    except GridFitError:
        return False
    return drift.offset_px <= options.largest_offset_px
