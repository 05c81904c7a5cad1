"""The toolbox's decode, against what the toolbox itself computed and against the scene."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.container import Capture, write_capture
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.container.packing import unpack
from lfstereo.errors import AssetError, ConfigError
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield import DecodeOptions, decode, read_light_field
from lfstereo.lightfield.lftoolbox import AlignedLattice, decode_as_lftoolbox, sample_as_lftoolbox
from lfstereo.lightfield.options import ViewOptions

TOLERANCE = 2e-5  # of full scale: one code of 16 bits is 1.53e-5
PARALLAX = 3.5


def grid_of_toolbox(model: dict[str, Any], shape: tuple[int, int]) -> LensletGrid:
    """Turn the toolbox's grid model, which counts px from 1, into a grid."""
    cos, sin = np.cos(model["Rot"]), np.sin(model["Rot"])
    return LensletGrid(
        origin_px=(model["HOffset"] - 1, model["VOffset"] - 1),
        step_u_px=(model["HSpacing"] * cos, model["HSpacing"] * sin),
        step_v_px=(-model["VSpacing"] * sin, model["VSpacing"] * cos),
        first_shifted_row=int(model["FirstPosShiftRow"]) - 1,
        rows=int(model["VMax"]),
        columns=int(model["UMax"]),
        sensor_shape=shape,
        residual_px=0.0,
        quality=1.0,
        source="given",
    )


@pytest.fixture(scope="module")
def crop(real_data: Path) -> tuple[Capture, Capture, LensletGrid, np.ndarray]:
    folder = real_data / "lftoolbox_reference" / "crop600"
    metadata = replace(read_camera_profile("lytro-illum"), width=600, height=600)

    def read(name: str) -> Capture:
        mosaic = unpack((folder / name).read_bytes(), 600, 600, 10, "little", name)
        return Capture(mosaic, metadata, name)

    grid = grid_of_toolbox(json.loads((folder / "grid_model.json").read_text()), (600, 600))
    reference = np.load(folder / "decoded.npz")["LF"].astype(np.float32) / 65535
    return read("lenslet.raw"), read("white.raw"), grid, reference


def test_equals_the_light_field_toolbox(crop: tuple[Capture, Capture, LensletGrid, np.ndarray]) -> None:
    photo, white, grid, reference = crop
    views, weight = sample_as_lftoolbox(photo, white, grid)
    assert views.shape == (15, 15, 48, 49, 3)
    np.testing.assert_allclose(views, reference[..., :3], atol=TOLERANCE)
    np.testing.assert_allclose(weight, reference[..., 3], atol=TOLERANCE)
    assert np.sqrt(np.mean((views - reference[..., :3]) ** 2)) < 2e-6


def test_own_grid_fit_gives_nearly_the_toolbox_s_views(
    crop: tuple[Capture, Capture, LensletGrid, np.ndarray],
) -> None:
    """Same lenslets, a better lattice: the views agree as far as the toolbox's grid does (0.07 px)."""
    photo, white, _, reference = crop
    found = decode(photo, white, DecodeOptions(method="lftoolbox"))
    assert found.views.shape[:2] == (15, 15)
    rows = min(found.views.shape[2], 48)
    centre = found.views[7, 7, :rows, :48, 1], reference[7, 7, :rows, :48, 1]
    assert abs(float(centre[0].mean() - centre[1].mean())) < 0.02


@pytest.fixture(scope="module")
def white(draw_frame: Callable[..., Any]) -> Capture:
    found: Capture = draw_frame(noise=0.5).capture
    return found


def test_sampling_tells_where_a_view_pixel_lies(draw_frame: Callable[..., Any], white: Capture) -> None:
    def texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.5 + 0.2 * np.sin(x / 23 + 0.3) * np.cos(y / 27)

    frame = draw_frame(scene=texture, parallax=PARALLAX, noise=0.5).capture
    found = decode(frame, white, DecodeOptions(method="lftoolbox"))
    assert found.weight is not None and found.sampling is not None
    assert found.serial == "SIM1"
    sampling = found.sampling
    v, u = np.mgrid[: found.views.shape[2], : found.views.shape[3]]
    cos, sin = np.cos(sampling.rotation_rad), np.sin(sampling.rotation_rad)
    x = sampling.origin_px[0] + cos * u * sampling.step_px[0] - sin * v * sampling.step_px[1]
    y = sampling.origin_px[1] + sin * u * sampling.step_px[0] + cos * v * sampling.step_px[1]
    inner = (slice(2, -2), slice(2, -2))
    for t, s in ((7, 7), (7, 3), (11, 7), (4, 9)):
        dx, dy = (s - 7) * sampling.view_step_px, (t - 7) * sampling.view_step_px
        lit = (found.weight[t, s] > 100)[inner]
        seen = found.views[t, s, ..., 1][inner]
        shown = texture(x + PARALLAX * dx, y + PARALLAX * dy)[inner]
        assert np.sqrt(np.mean((seen - shown)[lit] ** 2)) < 0.02
    assert not found.views[0, 0].any() and not found.weight[0, 0].any()


def test_alignment_of_an_illum(crop: tuple[Capture, Capture, LensletGrid, np.ndarray]) -> None:
    lattice = AlignedLattice.of(crop[2])
    assert lattice.spacing == (16, 14)
    assert lattice.sampling().view_step_px == pytest.approx(12.384216 / 14)
    aligned = np.array([*lattice.first, 1.0])
    expected = np.asarray(crop[2].origin_px)
    # The toolbox scales the offset of the lattice without turning it: at most 14 px * 0.002 rad * 1 %.
    assert lattice.to_raw @ aligned == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("shifted", [0, 1])
@pytest.mark.parametrize(("pitch", "count"), [(14.3, 15), (9.93, 9), (12.01, 13)])
def test_every_view_of_a_ramp_lies_where_the_sampling_says(pitch: float, count: int, shifted: int) -> None:
    """A brightness that grows evenly over the sensor comes through every linear step unchanged.

    The pitches are an Illum's and an F01's, whose x axis is the coarser one, and one whose y axis is.
    """
    shape, rotation, lean = (300, 340), 0.004, 0.05
    cos, sin = np.cos(rotation), np.sin(rotation)
    down = pitch * np.sqrt(3) / 2
    # A lean of the rows of lenslets by hundredths of a px each, which the toolbox straightens about the middle row.
    step_v = (-down * sin + lean * cos, down * cos + lean * sin)
    grid = LensletGrid((17.3, 18.1), (pitch * cos, pitch * sin), step_v, shifted, 15, 17, shape, 0.0, 1.0, "given")
    y, x = np.mgrid[: shape[0], : shape[1]]
    metadata = replace(read_camera_profile("lytro-illum"), width=shape[1], height=shape[0])
    ramp = np.rint(64 + 959 * (0.1 + 0.0015 * x + 0.001 * y)).astype(np.uint16)
    found = decode_as_lftoolbox(
        Capture(ramp, metadata, "ramp"), Capture(np.full(shape, 1023, np.uint16), metadata, "white"), grid
    )
    assert found.views.shape[:4] == (count, count, 15, int(np.ceil(17 * 2 / np.sqrt(3))))
    assert found.sampling is not None and found.weight is not None
    sampling, middle = found.sampling, count // 2
    v, u = np.mgrid[:15, : found.views.shape[3]]
    for t, s in ((middle, middle), (middle, middle - 3), (middle + 3, middle), (middle - 2, middle + 2)):
        across = u * sampling.step_px[0] + (s - middle) * sampling.view_step_px
        along = v * sampling.step_px[1] + (t - middle) * sampling.view_step_px
        true_x = sampling.origin_px[0] + cos * across - sin * along
        true_y = sampling.origin_px[1] + sin * across + cos * along
        expected = 0.1 + 0.0015 * true_x + 0.001 * true_y
        error = (found.views[t, s, ..., 1] - expected)[:, 1:-2]
        assert np.abs(error).max() < 1.0 / 959  # half a digital number of rounding, some more by the demosaic
        assert abs(error.mean()) < 1e-4
        assert (found.weight[t, s][:, 1:-2] == 255).all()


def test_what_the_method_cannot_do(draw_frame: Callable[..., Any], white: Capture) -> None:
    photo = draw_frame(scene=lambda x, y: 0.5 + 0 * x).capture
    with pytest.raises(AssetError, match="method lftoolbox: found no white image"):
        decode(photo, None, DecodeOptions(method="lftoolbox"))
    with pytest.raises(ConfigError, match="method lftoolbox: found options of the views"):
        decode(photo, white, DecodeOptions(method="lftoolbox", view=ViewOptions(views=9)))
    other = draw_frame(shape=(380, 440)).capture
    grid = LensletGrid((5, 5), (14.3, 0), (0, 12.4), 0, 2, 2, (400, 440), 0.0, 1.0, "given")
    with pytest.raises(AssetError, match="found a white image of 440 x 380 px, expected 440 x 400"):
        decode_as_lftoolbox(photo, other, grid)


@pytest.mark.parametrize("words", [["--method", "lftoolbox"], ["--config", "run.toml"]])
def test_method_on_the_command_line_and_in_a_file(
    tmp_path: Path, draw_frame: Callable[..., Any], white: Capture, words: list[str]
) -> None:
    (tmp_path / "run.toml").write_text('[decode]\nmethod = "lftoolbox"\n')
    write_capture(tmp_path / "MOD_0001.RAW", white)
    write_capture(tmp_path / "photo.LFR", draw_frame(scene=lambda x, y: 0.5 + 0 * x).capture)
    words = [str(tmp_path / word) if word.endswith(".toml") else word for word in words]
    whites = ["--whites", str(tmp_path / "MOD_0001.RAW")]
    assert main(["decode", str(tmp_path / "photo.LFR"), *whites, *words, "-o", str(tmp_path / "a.h5")]) == 0
    found = read_light_field(tmp_path / "a.h5")
    assert found.sampling is not None and found.sampling.view_step_px == pytest.approx(14.3 * 3**0.5 / 2 / 14, rel=1e-3)


def test_straight_to_a_file_of_the_toolbox(tmp_path: Path, draw_frame: Callable[..., Any], white: Capture) -> None:
    photo = draw_frame(scene=lambda x, y: 0.5 + 0.3 * np.sin(x / 20)).capture
    write_capture(tmp_path / "MOD_0001.RAW", white)
    write_capture(tmp_path / "photo.LFR", photo)
    target = tmp_path / "photo__Decoded.mat"
    whites = ["--whites", str(tmp_path / "MOD_0001.RAW")]
    assert main(["decode", str(tmp_path / "photo.LFR"), *whites, "--method", "lftoolbox", "-o", str(target)]) == 0
    expected = decode(photo, white, DecodeOptions(method="lftoolbox"))
    found = read_light_field(target)
    np.testing.assert_allclose(found.views, expected.views, atol=1e-7)  # not one code of 16 bits lost
    assert found.sampling == expected.sampling


def test_unknown_method_in_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.toml").write_text('[decode]\nmethod = "best"\n')
    words = ["decode", "photo.LFR", "--config", str(tmp_path / "run.toml"), "-o", str(tmp_path / "a.h5")]
    assert main(words) == 3
    assert "method = 'best' does not fit: expected one of direct, lftoolbox" in capsys.readouterr().err
