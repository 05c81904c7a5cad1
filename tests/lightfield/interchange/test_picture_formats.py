"""Folders of views, lenslet-packed pictures and the colour profile: written, read back, and refused."""

from __future__ import annotations

import configparser
import io
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from lfstereo.errors import ConfigError, ContainerError, OutputError
from lfstereo.lightfield import LightField, read_light_field
from lfstereo.lightfield.encoding import srgb16
from lfstereo.lightfield.interchange.formats import choose_format, export_light_field
from lfstereo.lightfield.interchange.icc import srgb_profile

CODE_8, CODE_16 = 0.5 / 255 * 2.3, 0.5 / 65535 * 2.3  # linear; the sRGB curve's slope below white is at most 2.3


@pytest.mark.parametrize(
    ("name", "place", "tolerance"),
    [("png", "views", CODE_8), ("hci", "scene", CODE_8), ("tiff", "views", CODE_16), ("eslf", "scene.png", CODE_16)],
)
def test_round_trip(tmp_path: Path, light_field: LightField, name: str, place: str, tolerance: float) -> None:
    export_light_field(tmp_path / place, light_field, choose_format(tmp_path / place, name))  # type: ignore[arg-type]
    found = read_light_field(tmp_path / place)
    np.testing.assert_allclose(found.views, np.clip(light_field.views, 0, 1), atol=tolerance)
    assert found.sampling == light_field.sampling
    assert found.serial == light_field.serial
    if name == "eslf":
        np.testing.assert_array_equal(found.weight, light_field.weight)
    else:
        assert found.weight is None
    with pytest.raises(OutputError, match="exists already"):
        export_light_field(tmp_path / place, light_field, choose_format(tmp_path / place, name))  # type: ignore[arg-type]


def test_benchmark_folder_reads_as_the_benchmark_s_own(tmp_path: Path, light_field: LightField) -> None:
    export_light_field(tmp_path / "scene", light_field, "hci")
    parameters = configparser.ConfigParser()
    parameters.read(tmp_path / "scene" / "parameters.cfg")
    assert parameters["extrinsics"]["num_cams_x"] == "5"
    assert parameters["intrinsics"]["image_resolution_y_px"] == "6"
    assert len(list((tmp_path / "scene").glob("input_Cam*.png"))) == 15
    (tmp_path / "scene" / "light_field.toml").unlink()
    found = read_light_field(tmp_path / "scene")  # the number of views now comes from parameters.cfg
    assert found.sampling is None
    np.testing.assert_allclose(found.views, np.clip(light_field.views, 0, 1), atol=CODE_8)
    (tmp_path / "scene" / "parameters.cfg").write_text("[extrinsics]\nnum_cams_x = nine\n")
    with pytest.raises(ContainerError, match="found no num_cams_x and num_cams_y"):
        read_light_field(tmp_path / "scene")


def test_packed_picture_is_laid_out_by_lenslets(tmp_path: Path, light_field: LightField) -> None:
    export_light_field(tmp_path / "scene.png", light_field)
    picture = cv2.imread(str(tmp_path / "scene.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (6 * 3, 8 * 5, 4) and picture.dtype == np.uint16
    t, s, v, u = 2, 4, 5, 1
    np.testing.assert_array_equal(picture[v * 3 + t, u * 5 + s, 2::-1], srgb16(light_field.views[t, s, v, u]))
    assert light_field.weight is not None
    assert picture[v * 3 + t, u * 5 + s, 3] == 257 * int(light_field.weight[t, s, v, u])


def test_packed_picture_of_other_programs_has_14_views(tmp_path: Path) -> None:
    packed = np.zeros((2 * 14, 3 * 14, 3), np.uint8)
    packed[14 + 5, 28 + 9] = 255
    cv2.imwrite(str(tmp_path / "scene.png"), packed)
    found = read_light_field(tmp_path / "scene.png")
    assert found.views.shape == (14, 14, 2, 3, 3)
    assert found.views[5, 9, 1, 2].tolist() == [1, 1, 1] and found.views.sum() == 3
    assert found.weight is None and found.sampling is None


def test_tiff_carries_a_profile_of_srgb(tmp_path: Path, light_field: LightField) -> None:
    export_light_field(tmp_path / "views", light_field, "tiff")
    with tifffile.TiffFile(tmp_path / "views" / "view_01_02.tif") as file:
        page = file.pages[0]
        assert page.dtype == np.uint16 and page.shape == (6, 8, 3)
        assert page.tags["InterColorProfile"].value == srgb_profile()


def test_profile_maps_srgb_onto_itself() -> None:
    """A colour engine turns pictures tagged with the profile into its own sRGB without a change."""
    cms = pytest.importorskip("PIL.ImageCms")
    from PIL import Image

    ours, theirs = cms.ImageCmsProfile(io.BytesIO(srgb_profile())), cms.createProfile("sRGB")
    assert cms.getProfileDescription(ours).strip() == "sRGB"
    picture = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    turned = np.asarray(cms.profileToProfile(Image.fromarray(picture), ours, theirs))
    assert np.abs(turned.astype(int) - picture).max() <= 1


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "cannot be read as a PNG in colour"),
        (b"no picture", "cannot be read as a PNG in colour"),
        (cv2.imencode(".png", np.zeros((28, 28), np.uint8))[1].tobytes(), "cannot be read as a PNG in colour"),
        (cv2.imencode(".png", np.zeros((28, 29, 3), np.uint8))[1].tobytes(), "found 29 x 28 px, expected a multiple"),
    ],
)
def test_pictures_that_are_not_packed(tmp_path: Path, content: bytes, match: str) -> None:
    (tmp_path / "scene.png").write_bytes(content)
    with pytest.raises(ContainerError, match=match):
        read_light_field(tmp_path / "scene.png")


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("views = [3, 5]", "views = [0, 5]", "expected a text and positive numbers"),
        ("views = [3, 5]", "views = 3", "not a description of a light field"),
        ("views = [3, 5]", "views = [3, 4]", r"found 3 x 5 views, expected 3 x 4 as in light_field\.toml"),
        ("view_step_px = 0.884", "view_step_px = -1.0", "expected finite numbers and positive steps"),
        ("view_step_px = 0.884", "", "not a description of a light field"),
        ("[sampling]", "[sampling", "not a description of a light field"),
    ],
)
def test_damaged_description(tmp_path: Path, light_field: LightField, old: str, new: str, match: str) -> None:
    export_light_field(tmp_path / "views", light_field)
    beside = tmp_path / "views" / "light_field.toml"
    assert old in beside.read_text()
    beside.write_text(beside.read_text().replace(old, new))
    with pytest.raises(ContainerError, match=match):
        read_light_field(tmp_path / "views")


def test_without_weight_and_sampling(tmp_path: Path, light_field: LightField) -> None:
    bare = replace(light_field, weight=None, sampling=None, serial='odd "name"')
    for place in ("scene.png", "views", "scene.mat"):
        export_light_field(tmp_path / place, bare)
        found = read_light_field(tmp_path / place)
        assert found.weight is None and found.sampling is None
        assert found.serial == bare.serial


def test_names_that_fit_no_format() -> None:
    with pytest.raises(ConfigError, match=r"found the suffix '\.jpg', expected \.h5"):
        choose_format(Path("scene.jpg"))
    with pytest.raises(ConfigError, match=r"found the suffix '\.png', expected a file name ending in \.mat"):
        choose_format(Path("scene.png"), "mat")
    with pytest.raises(ConfigError, match=r"found the suffix '\.mat', expected a folder for format hci"):
        choose_format(Path("scene.mat"), "hci")
