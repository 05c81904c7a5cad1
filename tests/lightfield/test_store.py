"""Light fields written and read back, and files that must be refused."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from lfstereo.errors import ContainerError, OutputError
from lfstereo.lightfield import LightField, ViewSampling, read_light_field, write_light_field
from lfstereo.lightfield.encoding import from_codes, to_codes

SAMPLING = ViewSampling(origin_px=(1.5, -2.25), step_px=(12.4, 12.375), rotation_rad=-5e-4, view_step_px=0.884)


@pytest.fixture
def light_field() -> LightField:
    rng = np.random.default_rng(0)
    views = rng.gamma(1.0, 0.3, (3, 5, 12, 14, 3)).astype(np.float32)
    views[0, 0, 0, 0] = 7.5
    return LightField(views, rng.integers(0, 256, views.shape[:4], dtype=np.uint8), SAMPLING, "B51", "IMG_0001.LFR")


@pytest.fixture
def stored(tmp_path: Path, light_field: LightField) -> Path:
    path = tmp_path / "scene.h5"
    write_light_field(path, light_field)
    return path


def test_round_trip(stored: Path, light_field: LightField) -> None:
    found = read_light_field(stored)
    # Square-root codes: the step at 1.0 is 2 sqrt(7.5) / 65535 = 8.4e-5, finer below.
    assert np.abs(found.views - light_field.views).max() < 1.3e-4
    dark = light_field.views < 0.01
    assert np.abs(found.views - light_field.views)[dark].max() < 5e-6
    assert found.views.max() == pytest.approx(7.5, abs=1e-4)
    assert np.array_equal(found.weight, light_field.weight)
    assert (found.sampling, found.serial, found.source) == (SAMPLING, "B51", str(stored))


def test_colour_space_is_kept(tmp_path: Path, stored: Path, light_field: LightField) -> None:
    write_light_field(tmp_path / "wide.h5", replace(light_field, colour_space="prophoto"))
    assert read_light_field(tmp_path / "wide.h5").colour_space == "prophoto"
    with h5py.File(stored, "r+") as file:
        del file.attrs["colour_space"]  # as written before there was a choice
    assert read_light_field(stored).colour_space == "srgb"
    with h5py.File(stored, "r+") as file:
        file.attrs["colour_space"] = "cmyk"
    with pytest.raises(ContainerError, match="found colour space 'cmyk', expected display-p3, prophoto, srgb"):
        read_light_field(stored)


@pytest.mark.skipif(shutil.which("octave") is None, reason="GNU Octave is not installed")
def test_octave_opens_it(stored: Path, light_field: LightField) -> None:
    """Octave reads no attributes: what the codes mean is a variable."""
    script = (
        f"f = load('{stored}'); disp(size(f.views)); disp(class(f.views)); disp(double(f.weight(3, 2, 4, 1)));"
        "printf('%.6f\\n', f.peak * (double(f.views(2, 8, 6, 5, 1)) / 65535) ^ 2)"
    )
    done = subprocess.run(["octave", "-q", "--eval", script], capture_output=True, text=True, check=True)
    words = done.stdout.split()
    assert words[:6] == ["3", "14", "12", "5", "3", "uint16"]
    assert light_field.weight is not None
    assert words[6] == str(light_field.weight[0, 3, 1, 2])
    assert float(words[7]) == pytest.approx(float(light_field.views[0, 4, 5, 7, 1]), abs=1.3e-4)


def test_twice_stored_is_the_same(stored: Path, tmp_path: Path) -> None:
    once = read_light_field(stored)
    write_light_field(tmp_path / "again.h5", once)
    assert np.array_equal(read_light_field(tmp_path / "again.h5").views, once.views)


def test_state_of_the_lens(stored: Path, tmp_path: Path, light_field: LightField) -> None:
    assert (read_light_field(stored).zoom_step, read_light_field(stored).focus_step) == (None, None)
    path = tmp_path / "zoomed.h5"
    write_light_field(path, replace(light_field, zoom_step=982, focus_step=-5))
    assert (read_light_field(path).zoom_step, read_light_field(path).focus_step) == (982, -5)
    with h5py.File(path, "a") as file:
        file.attrs["zoom_step"] = "far"
    with pytest.raises(ContainerError, match="'zoom_step' is 'far', expected a whole number"):
        read_light_field(path)


def test_without_weight_and_sampling(tmp_path: Path, light_field: LightField) -> None:
    write_light_field(tmp_path / "a.h5", LightField(light_field.views, None, None, "", "views"))
    found = read_light_field(tmp_path / "a.h5")
    assert found.weight is None
    assert found.sampling is None
    assert found.serial == ""


def test_negative_values_become_black() -> None:
    codes = to_codes(np.array([-0.5, 0.0, 1.0], np.float32), 1.0)
    assert from_codes(codes, 1.0).tolist() == [0.0, 0.0, 1.0]


def test_an_existing_file_is_kept_unless_forced(stored: Path, light_field: LightField) -> None:
    with pytest.raises(OutputError, match="exists already"):
        write_light_field(stored, light_field)
    write_light_field(stored, light_field, force=True)


def test_another_suffix_is_refused(tmp_path: Path, light_field: LightField) -> None:
    with pytest.raises(ContainerError, match=r"found the suffix '\.npz', expected \.h5"):
        write_light_field(tmp_path / "a.npz", light_field)
    (tmp_path / "a.npz").write_bytes(b"")
    with pytest.raises(ContainerError, match="decode a raw capture with 'lfstereo decode' first"):
        read_light_field(tmp_path / "a.npz")


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match="found no such file"):
        read_light_field(tmp_path / "a.h5")


def test_not_hdf5(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_bytes(b"no" * 2000)
    with pytest.raises(ContainerError, match="not a readable HDF5 file"):
        read_light_field(tmp_path / "a.h5")


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.98])
def test_cut_off(stored: Path, share: float) -> None:
    data = stored.read_bytes()
    stored.write_bytes(data[: int(share * len(data))])
    with pytest.raises(ContainerError):
        read_light_field(stored)


def test_flipped_bytes_never_crash(stored: Path) -> None:
    data = stored.read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(150):
        damaged = bytearray(data)
        for place in rng.integers(0, min(len(data), 9000), 4):
            damaged[place] ^= int(rng.integers(1, 256))
        stored.write_bytes(damaged)
        try:
            found = read_light_field(stored)
        except ContainerError:
            continue
        assert np.isfinite(found.views).all()


def remove(name: str) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file[name]

    return change


def attribute(place: str, name: str, value: Any) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        if value is None:
            del file[place].attrs[name]
        else:
            file[place].attrs[name] = value

    return change


def replaced(name: str, array: np.ndarray) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file[name]
        file[name] = array

    return change


def unwritten(file: Any) -> None:
    del file["views"]
    made = file.create_dataset("views", (300, 300, 100, 100, 3), np.uint16, chunks=(1, 1, 100, 100, 3))
    made.attrs["encoding"], made.attrs["peak"] = "square root", 1.0


def elsewhere(file: Any) -> None:
    del file["views"]
    made = file.create_dataset("views", (3, 5, 12, 14, 3), np.uint16, external=[("/etc/hostname", 0, 15120)])
    made.attrs["encoding"], made.attrs["peak"] = "square root", 1.0


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (remove("views"), "found no dataset 'views'"),
        (attribute("/", "format", "other"), "format 'other', expected 'lfstereo light field'"),
        (attribute("/", "format", None), "found no text 'format'"),
        (attribute("/", "version", 2), "found format version 2, expected 1"),
        (attribute("/", "version", None), "found format version None"),
        (attribute("/", "serial", 5), "found no text 'serial'"),
        (attribute("views", "peak", None), "peak None"),
        (attribute("views", "peak", -1.0), r"peak -1\.0"),
        (attribute("views", "peak", np.nan), "peak nan"),
        (attribute("views", "encoding", "gamma"), "encoding 'gamma'"),
        (replaced("views", np.zeros((3, 5, 12, 14, 4), np.uint16)), "expected three colours last"),
        (replaced("views", np.zeros((3, 5, 12, 14, 3), np.float32)), "'views' is float32"),
        (replaced("views", np.zeros((3, 12, 14, 3), np.uint16)), "expected uint16 with 5 axes"),
        (replaced("weight", np.zeros((3, 5, 12, 13), np.uint8)), "weight has shape"),
        (unwritten, "the file was cut off"),
        (elsewhere, "does not lie in this file"),
        (attribute("sampling", "origin_px", [1.0, np.nan]), "sampling 'origin_px'"),
        (attribute("sampling", "step_px", None), r"sampling 'step_px' is \[\], expected 2 finite numbers"),
        (attribute("sampling", "view_step_px", -1.0), "expected positive ones"),
        (replaced("sampling", np.zeros(3)), "sampling 'origin_px'"),
    ],
)
def test_every_field_is_checked(stored: Path, change: Callable[[Any], None], match: str) -> None:
    with h5py.File(stored, "r+") as file:
        change(file)
    with pytest.raises(ValueError, match=match) as caught:
        read_light_field(stored)
    assert "\n" not in str(caught.value)
