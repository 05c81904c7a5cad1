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

from lfstereo.develop.colour_spaces import NAMES, PRIMARIES, conversion, decode_table
from lfstereo.develop.options import ColourSpace
from lfstereo.errors import ConfigError, ContainerError, OutputError
from lfstereo.lightfield import LightField, read_light_field
from lfstereo.lightfield.encoding import srgb8, srgb16, to_picture
from lfstereo.lightfield.field import in_srgb
from lfstereo.lightfield.interchange.formats import FormatName, choose_format, export_light_field
from lfstereo.lightfield.interchange.icc import icc_profile
from lfstereo.lightfield.options import PictureOptions

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
        assert page.tags["InterColorProfile"].value == icc_profile("srgb")


def test_profiles_are_understood_by_a_colour_engine() -> None:
    """Pictures tagged with our profiles, turned into sRGB by LittleCMS, against the matrices and curves here."""
    cms = pytest.importorskip("PIL.ImageCms")
    from PIL import Image

    theirs = cms.createProfile("sRGB")
    picture = np.random.default_rng(0).integers(60, 190, (16, 16, 3), dtype=np.uint8)
    for space, name in NAMES.items():
        ours = cms.ImageCmsProfile(io.BytesIO(icc_profile(space)))
        assert cms.getProfileDescription(ours).strip() == name
        turned = np.asarray(cms.profileToProfile(Image.fromarray(picture), ours, theirs, renderingIntent=1))
        light = decode_table(255, space)[picture] @ conversion(PRIMARIES[space], "srgb").T
        assert np.abs(turned.astype(int) - srgb8(light.astype(np.float32))).max() <= 2  # codes of 8 bits


@pytest.mark.parametrize(
    ("name", "place", "space"),
    [
        ("tiff", "views", "linear"),
        ("tiff", "views", "display-p3"),
        ("tiff", "views", "prophoto"),
        ("eslf", "a.png", "prophoto"),
        ("png", "views", "display-p3"),
    ],
)
def test_round_trip_in_other_colour_spaces(
    tmp_path: Path, light_field: LightField, name: FormatName, place: str, space: ColourSpace
) -> None:
    pictures = PictureOptions(colour_space=space, exposure_ev=-1.0)
    export_light_field(tmp_path / place, light_field, name, pictures=pictures)
    found = read_light_field(tmp_path / place)
    assert found.colour_space == PRIMARIES[space]
    inside = (light_field.views >= 0.02).all(-1)  # near black the curve of ProPhoto is at its coarsest
    step = 2 * (CODE_8 if name == "png" else CODE_16) + 1e-4  # the exposure doubles it; 1e-4 for rounded matrices
    np.testing.assert_allclose(in_srgb(found).views[inside], light_field.views[inside], atol=2 * step)
    assert in_srgb(found).views[1, 2, 3, 4, 0] == pytest.approx(1.5, abs=4 * step)  # headroom came along


def test_colour_space_is_named_where_other_programs_look(tmp_path: Path, light_field: LightField) -> None:
    image = pytest.importorskip("PIL.Image")
    export_light_field(tmp_path / "a", light_field, "png", pictures=PictureOptions("display-p3"))
    export_light_field(tmp_path / "b.png", light_field, pictures=PictureOptions("prophoto"))
    export_light_field(tmp_path / "c", light_field)
    with image.open(tmp_path / "a" / "view_00_00.png") as picture:
        assert picture.info["icc_profile"] == icc_profile("display-p3")
    with image.open(tmp_path / "b.png") as picture:
        assert picture.info["icc_profile"] == icc_profile("prophoto")
    with image.open(tmp_path / "c" / "view_00_00.png") as picture:
        assert picture.info["srgb"] == 0 and "icc_profile" not in picture.info


def test_wide_light_field_to_srgb_pictures(tmp_path: Path, light_field: LightField) -> None:
    wide = replace(
        light_field,
        views=(light_field.views @ conversion("srgb", "prophoto").T).astype(np.float32),
        colour_space="prophoto",
    )
    export_light_field(tmp_path / "views", wide, "tiff")
    found = read_light_field(tmp_path / "views")
    assert found.colour_space == "srgb"
    np.testing.assert_allclose(found.views, np.clip(light_field.views, 0, 1), atol=CODE_16 + 1e-4)
    for name in ("a.h5", "a.mat"):
        export_light_field(tmp_path / name, wide)
        assert read_light_field(tmp_path / name).colour_space == "prophoto"
    np.testing.assert_allclose(in_srgb(wide).views, light_field.views, atol=1e-4)
    assert in_srgb(light_field) is light_field


def test_soft_highlights_keep_hue_and_order() -> None:
    greys = np.repeat(np.linspace(0, 8, 801, dtype=np.float32)[:, None], 3, axis=1)
    soft = to_picture(greys, "srgb", PictureOptions("linear", "soft"))
    assert np.ptp(soft, axis=1).max() == 0
    assert (np.diff(soft[:, 0]) > -1e-6).all() and 0.99 < soft[-1, 0] <= 1
    np.testing.assert_array_equal(soft[:80], greys[:80])  # below the knee nothing changes
    assert np.abs(np.diff(soft[75:90, 0], 2)).max() < 1e-3  # and the knee has no corner
    orange = np.array([[4.0, 2.0, 0.4]], np.float32)
    bent = to_picture(orange, "srgb", PictureOptions("linear", "soft"))[0]
    assert bent / bent[0] == pytest.approx(orange[0] / 4)
    assert to_picture(orange, "srgb", PictureOptions("linear"))[0].tolist() == pytest.approx([1, 1, 0.4])


@pytest.mark.parametrize(
    ("place", "name", "pictures", "match"),
    [
        ("a.h5", None, PictureOptions("prophoto"), "format h5: found options of pictures"),
        ("a.mat", None, PictureOptions(highlights="soft"), "format mat: found options of pictures"),
        ("a", "png", PictureOptions("linear"), "found the colour space linear, expected srgb or display-p3"),
        ("a", "hci", PictureOptions("display-p3"), "found the colour space display-p3, expected srgb, as"),
    ],
)
def test_colours_that_a_format_cannot_hold(
    tmp_path: Path, light_field: LightField, place: str, name: FormatName | None, pictures: PictureOptions, match: str
) -> None:
    with pytest.raises(ConfigError, match=match):
        export_light_field(tmp_path / place, light_field, name, pictures=pictures)
    assert not (tmp_path / place).exists()


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
        ("views = [3, 5]", "views = [0, 5]", "expected 1 to 1000 each"),
        ("views = [3, 5]", "views = 3", "not a description of a light field"),
        ("views = [3, 5]", "views = [3, 4]", r"found 3 x 5 views, expected 3 x 4 as in light_field\.toml"),
        ("view_step_px = 0.884", "view_step_px = -1.0", "expected finite numbers and positive steps"),
        ("view_step_px = 0.884", "", "not a description of a light field"),
        ("[sampling]", "[sampling", "not a description of a light field"),
        ('colour_space = "srgb"', 'colour_space = "cmyk"', "found colour space 'cmyk' and exposure 0 EV"),
        ("exposure_ev = 0.0", "exposure_ev = nan", "found colour space 'srgb' and exposure nan EV"),
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
