"""Which grid a photograph is decoded with, and what is said when none fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lfstereo.container import Capture, write_capture
from lfstereo.container.serials import camera_mark
from lfstereo.errors import AssetError, GridFitError
from lfstereo.lenslet import choice, remembered_grid
from lfstereo.lenslet.choice import choose_grid
from lfstereo.lenslet.drift import measure_drift
from lfstereo.lenslet.fit import fit_grid
from lfstereo.lenslet.imported import import_whites
from lfstereo.lenslet.lattice import Lattice

SHAPE = (360, 380)
OFFSET_PX = 0.02
"""A drawn white image's grid against its own frame."""
PHOTOGRAPH_OFFSET_PX = 0.06


def texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.5 + 0.25 * np.sin(x / 19 + 0.3) * np.cos(y / 23) + 0.2 * np.sin((x + 2 * y) / 41)


def pitch_at(zoom: int) -> float:
    """Half a px more across the frame from zoom 0 to zoom 100."""
    return 14.3 * (1 + 0.0026 * zoom / 100)


@pytest.fixture(scope="module")
def frames(draw_frame: Callable[..., Any]) -> SimpleNamespace:
    """White images at zoom 0 and 100, and photographs at zoom 0 and 50."""

    def white(zoom: int) -> Capture:
        return draw_frame(shape=SHAPE, pitch=pitch_at(zoom), origin=(190.0, 180.0)).capture

    def photograph(zoom: int) -> Any:
        return draw_frame(shape=SHAPE, pitch=pitch_at(zoom), origin=(190.0, 180.0), scene=texture, parallax=2.0)

    return SimpleNamespace(white={z: white(z) for z in (0, 100)}, photograph={z: photograph(z) for z in (0, 50)})


@pytest.fixture
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LFSTEREO_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


def at(frame: Any, files: SimpleNamespace, zoom: int, **changes: Any) -> Capture:
    capture: Capture = frame.capture
    return replace(capture, metadata=files.asked(capture, zoom=zoom, **changes))


@pytest.fixture
def whites(tmp_path: Path, camera_files: SimpleNamespace, frames: SimpleNamespace) -> Path:
    for zoom, capture in frames.white.items():
        camera_files.put(tmp_path / "whites", f"MOD_{zoom:04}", capture, zoom=zoom)
    return tmp_path / "whites"


def test_drift_is_measured_and_half_a_lenslet_is_noticed(frames: SimpleNamespace) -> None:
    grid = fit_grid(frames.white[0])
    assert measure_drift(frames.white[0], grid).offset_px < OFFSET_PX
    x, y = grid.origin_px
    drift = measure_drift(frames.photograph[0].capture, replace(grid, origin_px=(x + 0.3, y - 0.4)))
    assert drift.offset_px == pytest.approx(0.5, abs=PHOTOGRAPH_OFFSET_PX)
    assert drift.shift_px == pytest.approx((-0.3, 0.4), abs=PHOTOGRAPH_OFFSET_PX)
    for dx, dy in ((7.15, 0.0), (7.15, 4.13), (0.0, 8.26)):
        with pytest.raises(GridFitError, match="no brighter middle where the grid has its lenslets"):
            measure_drift(frames.white[0], replace(grid, origin_px=(x + dx, y + dy)))


def test_dark_frame_has_no_micro_images(frames: SimpleNamespace) -> None:
    white = frames.white[0]
    with pytest.raises(GridFitError, match="no brighter middle"):
        measure_drift(replace(white, mosaic=np.full_like(white.mosaic, 64)), fit_grid(white))


def test_white_image_at_the_same_zoom(whites: Path, camera_files: SimpleNamespace, frames: SimpleNamespace) -> None:
    found = choose_grid(at(frames.photograph[0], camera_files, 0), whites)
    assert found.grid.source == "white image" and not found.warning
    assert found.offset_px is not None and found.offset_px < PHOTOGRAPH_OFFSET_PX
    assert found.white_moved() is None


def test_grid_between_two_zoom_steps(whites: Path, camera_files: SimpleNamespace, frames: SimpleNamespace) -> None:
    photograph = at(frames.photograph[50], camera_files, 50)
    found = choose_grid(photograph, whites)
    assert found.grid.source == "white images" and not found.warning
    error = frames.photograph[50].lattice_error(found.grid.centres())
    nearest = frames.photograph[50].lattice_error(fit_grid(frames.white[0]).centres())
    assert np.hypot(*error.T).max() < 0.1 * np.hypot(*nearest.T).max()
    # The map leads from each lenslet to the same one in the white image.
    moved, white_grid = found.white_moved(), found.white_grid
    assert moved is not None and white_grid is not None
    there = Lattice.of(white_grid)
    points = np.column_stack([found.grid.centres().reshape(-1, 2), np.ones(found.grid.rows * found.grid.columns)])
    index = (points @ moved.T - there.origin) @ there.reciprocal.T
    assert np.abs(index - np.round(index)).max() < 1e-6
    assert np.hypot(*(points @ moved.T - points[:, :2]).T).max() < 1


def test_nearest_is_kept_where_it_fits_better(
    whites: Path, camera_files: SimpleNamespace, frames: SimpleNamespace
) -> None:
    # The lens says half way, the micro-images lie as at zoom 0.
    found = choose_grid(at(frames.photograph[0], camera_files, 50), whites)
    assert found.grid.source == "white image"


def test_hot_pixels_travel_along(whites: Path, camera_files: SimpleNamespace, frames: SimpleNamespace) -> None:
    camera_files.put_factory_files(whites, "SIM1", {}, [(4, 5)])
    found = choose_grid(at(frames.photograph[0], camera_files, 0), whites)
    assert found.hot_pixels is not None and found.hot_pixels.tolist() == [[4, 5]]


@pytest.mark.parametrize("given", [True, False])
def test_no_white_image_of_this_camera(
    whites: Path, own_home: Path, camera_files: SimpleNamespace, frames: SimpleNamespace, given: bool
) -> None:
    photograph = at(frames.photograph[0], camera_files, 0, serial="SIM9")
    found = choose_grid(photograph, whites if given else None)
    assert found.grid.source == "photograph" and found.white is None and found.offset_px is None
    reason = "found white images of camera #fb1c, expected #f7d2" if given else "no white images were given"
    assert reason in found.warning
    assert "of its lenslets agree, standard error 0.0" in found.warning
    assert "\n" not in found.warning


def test_white_image_whose_grid_lies_elsewhere(
    tmp_path: Path, camera_files: SimpleNamespace, frames: SimpleNamespace, draw_frame: Callable[..., Any]
) -> None:
    other = draw_frame(shape=SHAPE, origin=(191.5, 181.5)).capture
    camera_files.put(tmp_path, "MOD_0001", other)
    found = choose_grid(at(frames.photograph[0], camera_files, 0), tmp_path)
    assert found.grid.source == "photograph" and found.white is None
    assert "off the picture's own micro-images, at most 0.5 px are trusted" in found.warning


def test_unknown_serial_takes_the_camera_that_fits(
    tmp_path: Path, camera_files: SimpleNamespace, frames: SimpleNamespace, draw_frame: Callable[..., Any]
) -> None:
    other = draw_frame(shape=SHAPE, origin=(190.3, 180.2)).capture
    camera_files.put(tmp_path / "a", "MOD_0001", other, serial="OTHER")
    camera_files.put(tmp_path / "b", "MOD_0001", frames.white[0], serial="RIGHT")
    found = choose_grid(at(frames.photograph[0], camera_files, 0, serial=""), tmp_path)
    assert found.white is not None and found.white.metadata.serial == "RIGHT"
    assert "tells no serial number" in found.warning and "px off the picture's micro-images" in found.warning


def test_one_white_image(tmp_path: Path, whites: Path, camera_files: SimpleNamespace, frames: SimpleNamespace) -> None:
    photograph = at(frames.photograph[0], camera_files, 0)
    assert choose_grid(photograph, whites / "MOD_0000.RAW").grid.source == "white image"
    with pytest.raises(AssetError, match=f"expected {camera_mark('SIM9')}"):
        choose_grid(replace(photograph, metadata=replace(photograph.metadata, serial="SIM9")), whites / "MOD_0000.RAW")


def test_imported_white_images_are_used(
    whites: Path, own_home: Path, camera_files: SimpleNamespace, frames: SimpleNamespace
) -> None:
    done = import_whites(whites, choice.library_folder())
    assert (len(done.whites), done.copied, done.kept) == (2, 4, 0)
    again = import_whites(whites, choice.library_folder())
    assert (again.copied, again.kept) == (0, 4)
    assert sorted(p.name for p in (own_home / "whites" / "SIM1").iterdir())[0] == "MOD_0000.RAW"
    assert choose_grid(at(frames.photograph[0], camera_files, 0), None).grid.source == "white image"


def test_import_refuses_what_it_cannot_file(
    tmp_path: Path, camera_files: SimpleNamespace, small_white: Capture
) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(AssetError, match="found no white image"):
        import_whites(tmp_path / "empty", tmp_path / "library")
    camera_files.put(tmp_path / "nameless", "MOD_0001", small_white, serial="")
    with pytest.raises(AssetError, match="found no serial number"):
        import_whites(tmp_path / "nameless", tmp_path / "library")
    assert not (tmp_path / "library").exists()


def test_grid_is_fitted_once(own_home: Path, frames: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    white = frames.white[0]
    first = remembered_grid.remembered_grid(white)
    assert first == fit_grid(white)
    monkeypatch.setattr(remembered_grid, "fit_grid", lambda *_: pytest.fail("fitted again"))
    assert remembered_grid.remembered_grid(white) == first


def test_remembered_grid_depends_on_frame_and_options(own_home: Path, frames: SimpleNamespace) -> None:
    white = frames.white[0]
    first = remembered_grid.remembered_grid(white)
    changed = remembered_grid.remembered_grid(white, choice.GridOptions(field_degree=2))
    assert first.field is None and changed.field is not None
    assert remembered_grid.remembered_grid(white, choice.GridOptions(field_degree=2)) == changed
    assert remembered_grid.remembered_grid(frames.white[100]) != first


def test_photograph_that_names_another_white(tmp_path: Path, small_white: Capture) -> None:
    write_capture(tmp_path / "IMG.LFR", small_white)
    from lfstereo.container import read_capture

    assert read_capture(tmp_path / "IMG.LFR").metadata.geometry_ref.startswith("sha1-")
