"""Decoded light fields in MATLAB's files."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from lfstereo.errors import ContainerError
from lfstereo.lightfield import LightField, read_light_field
from lfstereo.lightfield.interchange.lftoolbox_mat import write_decoded_mat

CODE = 0.5 / 65535 + 1e-7


@pytest.fixture
def stored(tmp_path: Path, light_field: LightField) -> Path:
    write_decoded_mat(tmp_path / "IMG_0001__Decoded.mat", light_field)
    return tmp_path / "IMG_0001__Decoded.mat"


def test_round_trip(stored: Path, light_field: LightField) -> None:
    found = read_light_field(stored)
    np.testing.assert_allclose(found.views, np.clip(light_field.views, 0, 1), atol=CODE)
    np.testing.assert_array_equal(found.weight, light_field.weight)
    assert found.sampling == light_field.sampling
    assert found.serial == light_field.serial


def test_bytes_are_those_of_matlab_7_3(stored: Path, light_field: LightField) -> None:
    head = stored.read_bytes()[:520]
    assert head.startswith(b"MATLAB 7.3 MAT-file, Platform: ") and b"HDF5 schema 1.00 ." in head[:116]
    assert head[116:128] == bytes(8) + b"\x00\x02IM"
    assert head[512:] == b"\x89HDF\r\n\x1a\n"
    with h5py.File(stored, "r") as file:
        views = file["LF"]
        assert views.shape == (4, 8, 6, 5, 3) and views.dtype == np.uint16  # LF(j, i, l, k, c) in reverse
        assert views.attrs["MATLAB_class"] == b"uint16"
        assert views[1, 7, 2, 4, 0] == round(float(light_field.views[0, 4, 2, 7, 1]) * 65535)
        assert views[0, 4, 3, 2, 1] == 65535  # 1.5 is clipped
        assert file["DecodeOptions/NWeightChans"][()] == [[1.0]]
        serial = file["LFMetadata/SerialData/camera/serialNumber"]
        assert serial.attrs["MATLAB_class"] == b"char"
        assert "".join(map(chr, serial[:, 0])) == "B5143909630"


def test_file_that_the_toolbox_wrote(tmp_path: Path) -> None:
    """As MATLAB stores it: compressed, no text of ours; and 8 bits in a MAT-file of version 5."""
    codes = np.random.default_rng(3).integers(0, 65536, (3, 3, 4, 5, 4), dtype=np.uint16)
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("LF", data=codes.T, compression="gzip", chunks=(2, 5, 4, 3, 3))
    scipy.io.savemat(tmp_path / "b.mat", {"LF": (codes >> 8).astype(np.uint8)})
    scipy.io.savemat(tmp_path / "c.mat", {"LF": codes[..., :3] / 65535.0})
    for name, tolerance in (("a.mat", 1e-6), ("b.mat", 1 / 255), ("c.mat", 1e-6)):
        found = read_light_field(tmp_path / name)
        np.testing.assert_allclose(found.views, codes[..., :3] / 65535, atol=tolerance)
        assert found.sampling is None and found.serial == ""
        assert (found.weight is None) == (name == "c.mat")


def test_files_without_a_light_field(tmp_path: Path, stored: Path) -> None:
    (tmp_path / "text.mat").write_text("no such thing")
    with pytest.raises(ContainerError, match="not a readable MAT-file"):
        read_light_field(tmp_path / "text.mat")
    scipy.io.savemat(tmp_path / "other.mat", {"x": 1})
    with pytest.raises(ContainerError, match="found no variable 'LF'"):
        read_light_field(tmp_path / "other.mat")
    with h5py.File(tmp_path / "other73.mat", "w") as file:
        file["x"] = 1
    with pytest.raises(ContainerError, match="found no variable 'LF'"):
        read_light_field(tmp_path / "other73.mat")
    scipy.io.savemat(tmp_path / "grey.mat", {"LF": np.zeros((3, 3, 4, 5), np.uint8)})
    with pytest.raises(ContainerError, match="'LF' is uint8 of size 3 x 3 x 4 x 5, expected views of three colours"):
        read_light_field(tmp_path / "grey.mat")
    scipy.io.savemat(tmp_path / "nan.mat", {"LF": np.full((3, 3, 4, 5, 3), np.nan)})
    with pytest.raises(ContainerError, match="values that are no numbers"):
        read_light_field(tmp_path / "nan.mat")
    (tmp_path / "cut.mat").write_bytes(stored.read_bytes()[:3000])
    with pytest.raises(ContainerError, match="not a readable MAT-file"):
        read_light_field(tmp_path / "cut.mat")
    with h5py.File(tmp_path / "empty.mat", "w") as file:
        file.create_dataset("LF", (3, 5, 4, 3, 3), np.uint16, chunks=(1, 5, 4, 1, 1))
    with pytest.raises(ContainerError, match="'LF' does not lie whole in this file"):
        read_light_field(tmp_path / "empty.mat")


def test_flipped_bytes_never_crash(tmp_path: Path, stored: Path) -> None:
    scipy.io.savemat(tmp_path / "old.mat", {"LF": np.ones((1, 1, 4, 5, 3), np.uint8)}, do_compression=True)
    generator = np.random.default_rng(11)
    for source in (stored, tmp_path / "old.mat"):
        whole = source.read_bytes()
        for _ in range(60):
            data = bytearray(whole)
            for place in generator.integers(0, min(len(data), 4000), 3):
                data[place] ^= 1 << generator.integers(0, 8)
            (tmp_path / "flipped.mat").write_bytes(data)
            try:
                read_light_field(tmp_path / "flipped.mat")
            except ContainerError as error:
                assert "flipped.mat" in str(error) and "\n" not in str(error)


@pytest.mark.skipif(shutil.which("octave") is None, reason="GNU Octave is not installed")
def test_octave_opens_it(stored: Path, light_field: LightField) -> None:
    script = f"load('{stored}'); disp(size(LF)); disp(LF(1, 5, 3, 8, 2)); disp(class(LF))"
    printed = subprocess.run(["octave", "-q", "--eval", script], capture_output=True, text=True, check=True).stdout
    assert printed.split()[:5] == ["3", "5", "6", "8", "4"]
    assert printed.split()[5:] == [str(round(float(light_field.views[0, 4, 2, 7, 1]) * 65535)), "uint16"]
