"""Which white image is taken for a photograph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lfstereo.container import Capture, write_capture
from lfstereo.errors import AssetError, ContainerError
from lfstereo.lenslet.white import find_white_image

SHAPE = (200, 220)


@pytest.fixture(scope="module")
def white(draw_frame: Callable[..., Any]) -> Capture:
    capture: Capture = draw_frame(shape=SHAPE).capture
    return capture


def put(folder: Path, name: str, capture: Capture, zoom: int = 0, focus: int = 0, **changes: Any) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    lens = replace(capture.metadata.lens, zoom_step=zoom, focus_step=focus)
    metadata = replace(capture.metadata, lens=lens, **changes)
    write_capture(folder / f"{name}.RAW", replace(capture, metadata=metadata))


def asked(capture: Capture, zoom: int = 0, focus: int = 0, **changes: Any) -> Any:
    lens = replace(capture.metadata.lens, zoom_step=zoom, focus_step=focus)
    return replace(capture.metadata, lens=lens, is_white_image=False, **changes)


def test_nearest_zoom_then_focus_of_the_same_camera(tmp_path: Path, white: Capture) -> None:
    put(tmp_path / "a", "MOD_0001", white, zoom=-500, focus=10)
    put(tmp_path / "a", "MOD_0002", white, zoom=-100, focus=10)
    put(tmp_path / "b" / "c", "MOD_0003", white, zoom=-100, focus=300)
    put(tmp_path / "a", "MOD_0004", white, zoom=-120, focus=250, serial="SIM2")
    found = find_white_image(tmp_path, asked(white, zoom=-120, focus=250))
    assert Path(found.source).name == "MOD_0003.RAW"


def test_dark_frames_are_passed_over(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", replace(white, mosaic=white.mosaic // 64 + 60))
    put(tmp_path, "MOD_0001", white, is_dark_frame=True)
    put(tmp_path, "MOD_0002", white, zoom=900)
    assert Path(find_white_image(tmp_path, asked(white)).source).name == "MOD_0002.RAW"


def test_only_dark_frames(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", replace(white, mosaic=white.mosaic // 64 + 60))
    with pytest.raises(AssetError, match="found only dark frames of camera #fb1c"):
        find_white_image(tmp_path, asked(white))


def test_photographs_are_no_white_images(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "IMG_0001", white, is_white_image=False)
    with pytest.raises(AssetError, match="found no white image, expected MOD_"):
        find_white_image(tmp_path, asked(white))


def test_other_cameras_white_images(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", white, serial="SIM2")
    put(tmp_path, "MOD_0001", white, serial="SIM3")
    with pytest.raises(AssetError, match="found white images of camera #5dda, #6b06, expected #fb1c"):
        find_white_image(tmp_path, asked(white))


def test_other_size(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", white)
    with pytest.raises(AssetError, match=r"expected #fb1c \(100 x 200 px\)"):
        find_white_image(tmp_path, asked(white, width=100))
    with pytest.raises(AssetError, match="found a white image of 220 x 200 px, expected 100 x 200"):
        find_white_image(tmp_path / "MOD_0000.RAW", asked(white, width=100))


def test_one_file(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", white)
    assert find_white_image(tmp_path / "MOD_0000.RAW", asked(white)).metadata.serial == "SIM1"
    with pytest.raises(AssetError, match="found a white image of camera #fb1c, expected #f7d2"):
        find_white_image(tmp_path / "MOD_0000.RAW", asked(white, serial="SIM9"))


def test_unknown_serial_takes_the_nearest(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", white, serial="SIM2")
    assert find_white_image(tmp_path, asked(white, serial="")).metadata.serial == "SIM2"


def test_no_folder(tmp_path: Path, white: Capture) -> None:
    with pytest.raises(AssetError, match="found no such folder"):
        find_white_image(tmp_path / "nowhere", asked(white))


def test_damaged_files_are_named_when_nothing_else_is_left(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", white)
    (tmp_path / "MOD_0000.TXT").write_text("{")
    with pytest.raises(AssetError, match=r"the first unreadable one: .*MOD_0000\.TXT"):
        find_white_image(tmp_path, asked(white))


def test_damaged_choice(tmp_path: Path, white: Capture) -> None:
    put(tmp_path, "MOD_0000", white)
    raw = tmp_path / "MOD_0000.RAW"
    raw.write_bytes(raw.read_bytes()[:-5])
    with pytest.raises(ContainerError):
        find_white_image(tmp_path, asked(white))
