"""Folders of views: the names that are understood, and those that are not."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.errors import ContainerError, OutputError, ShapeError
from lfstereo.lightfield import LightField, read_light_field
from lfstereo.lightfield.views import horizontal_epi, montage, vertical_epi
from lfstereo.lightfield.views_folder import write_views_folder


def view(t: int, s: int, size: tuple[int, int] = (6, 8)) -> np.ndarray:
    """Return a BGR picture that tells its own row and column."""
    return np.full((*size, 3), (0, 20 * t, 20 * s), np.uint8)


def put(folder: Path, names: dict[str, tuple[int, int]]) -> Path:
    folder.mkdir()
    for name, (t, s) in names.items():
        cv2.imwrite(str(folder / name), view(t, s))
    return folder


def order(light_field: LightField) -> list[list[tuple[int, int]]]:
    """Return for each place the row and column that its picture tells."""
    linear = ((np.arange(256) / 255 + 0.055) / 1.055) ** 2.4
    codes = np.abs(light_field.views[:, :, 0, 0, :2, None] - linear).argmin(-1)
    return [[(round(g / 20), round(r / 20)) for r, g in row] for row in codes]


GRID = [[(t, s) for s in range(3)] for t in range(3)]


@pytest.mark.parametrize(
    "pattern",
    ["view_{t:02d}_{s:02d}.png", "2067_{t:02d}_{s:02d}.png", "{t}_{s}.bmp", "input_Cam{n:03d}.png", "v-{t}-{s}.tif"],
)
@pytest.mark.parametrize("first", [0, 1])
def test_names_are_understood(tmp_path: Path, pattern: str, first: int) -> None:
    names = {pattern.format(t=t + first, s=s + first, n=3 * t + s + first): (t, s) for t in range(3) for s in range(3)}
    found = read_light_field(put(tmp_path / "views", names))
    assert found.views.shape == (3, 3, 6, 8, 3)
    assert order(found) == GRID
    assert (found.weight, found.sampling, found.serial) == (None, None, "")


def test_one_row_of_views(tmp_path: Path) -> None:
    found = read_light_field(put(tmp_path / "views", {f"v_0_{s}.png": (0, s) for s in range(5)}))
    assert found.views.shape[:2] == (1, 5)


def test_16_bit_views_keep_their_depth(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "v_0_0.png"), np.full((4, 4, 3), 48123, np.uint16))
    coded = 48123 / 65535
    assert read_light_field(tmp_path).views[0, 0, 0, 0, 0] == pytest.approx(((coded + 0.055) / 1.055) ** 2.4, rel=1e-5)


def test_written_views_are_read_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    views = rng.uniform(0, 1.2, (3, 3, 7, 9, 3)).astype(np.float32)
    light_field = LightField(views, None, None, "", "test")
    write_views_folder(tmp_path / "views", light_field)
    found = read_light_field(tmp_path / "views")
    # Half a step of 8-bit sRGB is 1/510 coded, at most 2.3 times that in linear light.
    assert np.abs(found.views - np.minimum(views, 1)).max() < 0.0046
    with pytest.raises(OutputError, match="exists already"):
        write_views_folder(tmp_path / "views", light_field)


def test_missing_view(tmp_path: Path) -> None:
    names = {f"v_{t}_{s}.png": (t, s) for t in range(3) for s in range(3) if (t, s) != (1, 2)}
    with pytest.raises(ContainerError, match="found 8 views, expected 3 x 3; row 1, column 2"):
        read_light_field(put(tmp_path / "views", names))


def test_numbers_that_make_no_square(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match="found 7 numbered views, expected a square number"):
        read_light_field(put(tmp_path / "views", {f"input_Cam{n:03d}.png": (0, 0) for n in range(7)}))


def test_the_same_view_twice(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match="are both row 0, column 1"):
        read_light_field(put(tmp_path / "views", {"a_0_0.png": (0, 0), "a_0_1.png": (0, 1), "b_0_1.png": (0, 1)}))


def test_no_views(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match="found 1 images but none named like a view"):
        read_light_field(put(tmp_path / "views", {"holiday.png": (0, 0)}))


def test_views_of_different_size(tmp_path: Path) -> None:
    put(tmp_path / "views", {"a_0_0.png": (0, 0)})
    cv2.imwrite(str(tmp_path / "views" / "a_0_1.png"), view(0, 1, (6, 9)))
    with pytest.raises(ShapeError, match=r"found a view of shape \(6, 9, 3\), expected \(6, 8, 3\)"):
        read_light_field(tmp_path / "views")


def test_damaged_view(tmp_path: Path) -> None:
    put(tmp_path / "views", {"a_0_0.png": (0, 0)})
    (tmp_path / "views" / "a_0_1.png").write_bytes(b"broken")
    with pytest.raises(ContainerError, match=r"a_0_1\.png: cannot be read as an 8-bit or 16-bit image"):
        read_light_field(tmp_path / "views")


def test_real_light_fields(real_data: Path) -> None:
    for name in ("hci_antinous", "lytro_2067"):
        assert read_light_field(real_data / "lf" / name).views.shape[:2] == (9, 9)


def test_epipolar_images_and_montage() -> None:
    views = np.random.default_rng(0).uniform(0, 1, (5, 7, 30, 40, 3)).astype(np.float32)
    light_field = LightField(views, None, None, "", "test")
    assert np.array_equal(horizontal_epi(light_field, 9), views[2, :, 9])
    assert np.array_equal(vertical_epi(light_field, 9), views[:, 3, :, 9])
    picture = montage(light_field, np.zeros((10, 20, 3), np.uint8))
    assert picture.dtype == np.uint8
    assert picture.shape[0] > 30 + 3 * 7 * 4
