"""Open the photographs of a calibration session and find the target in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lfstereo.container.capture import Capture, read_capture
from lfstereo.container.serials import camera_mark, same_camera
from lfstereo.errors import AssetError, GridFitError, TargetNotFoundError
from lfstereo.lenslet.drift import measure_drift
from lfstereo.lenslet.options import GridOptions
from lfstereo.lightfield.calibration import LensletCalibration, calibrate_photograph, decode_with
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import SUFFIXES, read_light_field
from lfstereo.progress import Progress, silent
from lfstereo.rig.bundle import LensPair, ShotPair, SizePair
from lfstereo.rig.corners import CornerOptions, find_corners
from lfstereo.rig.geometry import Side
from lfstereo.rig.rig import SensorGrid, StereoRig
from lfstereo.rig.sightings import Sightings, merge_views
from lfstereo.rig.target import Target
from lfstereo.rig.thin_lens import ThinLens, thin_lens_of_metadata

LensSteps = tuple[int | None, int | None]
"""Zoom and focus."""
_BLOCKS = 5
"""Views are averaged over this many blocks in both directions; see :func:`merge_views`."""


@dataclass(frozen=True, slots=True)
class Session:
    """What a session's photographs show."""

    pairs: tuple[ShotPair, ...]
    sizes_px: SizePair
    pixel_px: float
    """Sensor px per px of a view."""
    unusable: tuple[tuple[str, str], ...]
    """Name of each shot without a target, and why."""
    steps: tuple[LensSteps, LensSteps] = ((None, None), (None, None))
    """Zoom and focus step of the left and the right camera, where the captures tell."""
    grids: tuple[SensorGrid | None, SensorGrid | None] = (None, None)
    """The lattice of micro-images of the first shot of either camera."""
    lenses: LensPair = (None, None)
    """Either camera's lens as the metadata of raw captures tell."""

    def labelled(self, rig: StereoRig) -> StereoRig:
        """Return the rig with the zoom and focus steps and the lattices of micro-images that it holds for."""
        left, right = (
            replace(camera, zoom_step=zoom, focus_step=focus, grid=grid)
            for camera, (zoom, focus), grid in zip((rig.left, rig.right), self.steps, self.grids, strict=True)
        )
        return replace(rig, left=left, right=right)


def see_targets(
    shots: Sequence[tuple[str, Path, Path]],
    target: Target,
    whites: Path | None,
    options: CornerOptions = CornerOptions(),
    progress: Progress = silent,
) -> Session:
    """Open all shots of both cameras and find the target in all their views.

    Parameters
    ----------
    shots
        Name, left and right capture of each; raw or light fields.
    target
        The board.
    whites
        Folder of the cameras' white images; ``None``: those imported before.

    Warns
    -----
    QualityWarning
        If no white image fits a raw capture.

    Raises
    ------
    AssetError
        If one side's shots differ in camera, zoom, focus or size, or both sides' were taken by one camera.
    TargetNotFoundError
        If no shot shows the target to both cameras.
    """
    sides = (ShotSide("left", whites), ShotSide("right", whites))
    pairs, unusable = [], []
    for done, (name, *paths) in enumerate(shots):
        seen: list[Sightings] = []
        for number, (side, path) in enumerate(zip(sides, paths, strict=True)):
            light_field = side.open(path)
            try:
                seen.append(merge_views(find_corners(light_field, target, options), _BLOCKS))
            except TargetNotFoundError as error:
                unusable.append((name, str(error)))
                break
            del light_field
            progress(2 * done + number + 1, 2 * len(shots))
        if len(seen) == 2:
            _refuse_one_camera(name, seen)
            pairs.append(ShotPair(name, seen[0], seen[1]))
    if not pairs:
        raise TargetNotFoundError(
            f"none of {len(shots)} shots shows the target to both cameras; the first: {unusable[0][1]}"
            if unusable
            else "found no shots, expected photographs of the target by both cameras"
        )
    return Session(
        pairs=tuple(pairs),
        sizes_px=(sides[0].size_px, sides[1].size_px),
        pixel_px=sides[0].pixel_px,
        unusable=tuple(unusable),
        steps=(sides[0].steps, sides[1].steps),
        grids=(sides[0].grid, sides[1].grid),
        lenses=(sides[0].lens, sides[1].lens),
    )


def _refuse_one_camera(name: str, seen: Sequence[Sightings]) -> None:
    left, right = seen
    if left.serial and right.serial and same_camera(left.serial, right.serial):
        raise AssetError(
            f"shot {name}: {left.source} and {right.source} were both taken by camera {camera_mark(left.serial)}, "
            "expected two cameras; give each camera's photographs as one side"
        )


@dataclass(slots=True)
class ShotSide:
    """One camera's shots: the state that they must share, and the lenslet grid that fitted the last one."""

    name: Side
    whites: Path | None
    first: str = ""
    state: tuple[object, ...] = ()
    size_px: tuple[int, int] = (0, 0)
    pixel_px: float = 1.0
    steps: LensSteps = (None, None)
    grid: SensorGrid | None = None
    lens: ThinLens | None = None
    lenslets: LensletCalibration | None = None

    def open(self, path: Path) -> LightField:
        """Decode a capture, or read a light field.

        Raises
        ------
        AssetError
            If a capture comes from another camera, or another state of the camera, than the first one.
        """
        light_field = self._opened(path)
        if self.grid is None and (sampling := light_field.sampling) is not None:
            self.grid = SensorGrid(sampling.origin_px, sampling.step_px, sampling.rotation_rad)
        return light_field

    def _opened(self, path: Path) -> LightField:
        if path.suffix.lower() in SUFFIXES:
            light_field = read_light_field(path)
            self.steps = light_field.zoom_step, light_field.focus_step
            self._agree(path, (camera_mark(light_field.serial), light_field.views.shape[2:4], *self.steps))
            rows, columns = light_field.views.shape[2:4]
            step = light_field.sampling.step_px if light_field.sampling else (1.0, 1.0)
            self.size_px, self.pixel_px = (round(columns * step[0]), round(rows * step[1])), step[1]
            return light_field
        capture = read_capture(path)
        found = capture.metadata
        self.steps = found.lens.zoom_step, found.lens.focus_step
        self._agree(path, (camera_mark(found.serial), (found.height, found.width), *self.steps))
        light_field = self._decoded(capture)
        self.lens = thin_lens_of_metadata(found)
        self.size_px = (found.width, found.height)
        self.pixel_px = light_field.sampling.step_px[1] if light_field.sampling else 1.0
        return light_field

    def _decoded(self, capture: Capture) -> LightField:
        if self.lenslets is None or not _fits(capture, self.lenslets):
            self.lenslets = calibrate_photograph(capture, self.whites)
        return decode_with(capture, self.lenslets)

    def _agree(self, path: Path, state: tuple[object, ...]) -> None:
        if not self.first:
            self.first, self.state = str(path), state
        names = ("camera", "picture size", "zoom step", "focus step")
        for name, found, expected in zip(names, state, self.state, strict=False):
            if found != expected:
                raise AssetError(
                    f"{path}: {name} {found}, expected {expected} as {self.first}; all {self.name} shots must be "
                    "taken by one camera without touching zoom and focus; move this one away"
                )


def _fits(capture: Capture, lenslets: LensletCalibration, options: GridOptions = GridOptions()) -> bool:
    """Return whether a capture's micro-images lie where the grid of an earlier one has them."""
    try:
        return measure_drift(capture, lenslets.grid, options).offset_px <= options.largest_offset_px
    except GridFitError:
        return False
