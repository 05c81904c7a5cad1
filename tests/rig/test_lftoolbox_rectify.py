"""The toolbox's rectification, against what the toolbox itself computed and against closed forms."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lfstereo.container import Capture
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.container.packing import unpack
from lfstereo.errors import RigError, ShapeError
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield import lftoolbox as decoder
from lfstereo.lightfield.field import LightField
from lfstereo.rig.lftoolbox import ToolboxIntrinsics, rectify_as_lftoolbox, requested_intrinsics, resample_rays

CODE = 1 / 65535
H = np.diag([6e-4, 6e-4, 0.011, 0.011, 1.0])
H[:4, 4] = -H[:4, :4] @ [2, 2, 5, 4.5]
STRAIGHT = ToolboxIntrinsics(H, np.zeros(5))


@pytest.fixture(scope="module")
def toolbox(real_data: Path) -> tuple[np.ndarray, ToolboxIntrinsics, np.ndarray, np.ndarray]:
    folder = real_data / "lftoolbox_reference" / "crop600"
    decoded = np.load(folder / "decoded.npz")["LF"].astype(np.float32) / np.float32(65535)
    found = np.load(folder / "rectified.npz")
    return decoded, ToolboxIntrinsics(found["Hc"], found["dv"].ravel()), found["Hr"], found["LR"] / 65535


def test_equals_the_light_field_toolbox(
    toolbox: tuple[np.ndarray, ToolboxIntrinsics, np.ndarray, np.ndarray],
) -> None:
    """Both files are rounded to codes of 16 bits, after the toolbox had computed one from the other unrounded."""
    decoded, measured, requested, reference = toolbox
    found = resample_rays(decoded, measured, requested)
    error = np.abs(found - reference)
    assert error.max() < 1.1 * CODE
    assert np.mean(error > 1e-5) < 0.06
    assert np.sqrt(np.mean(error**2)) < 0.34 * CODE, "rounding of the result alone gives 0.289"
    assert np.array_equal(found[..., 3] > 0.5 * CODE, reference[..., 3] > 0)


def test_equals_the_light_field_toolbox_from_unrounded_samples(
    toolbox: tuple[np.ndarray, ToolboxIntrinsics, np.ndarray, np.ndarray],
    real_data: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the weight, which this package can decode without rounding; what is left differs already in the decode."""
    _, measured, requested, reference = toolbox
    folder = real_data / "lftoolbox_reference" / "crop600"
    metadata = replace(read_camera_profile("lytro-illum"), width=600, height=600)
    photo, white = (
        Capture(unpack((folder / name).read_bytes(), 600, 600, 10, "little", name), metadata, name)
        for name in ("lenslet.raw", "white.raw")
    )
    model = json.loads((folder / "grid_model.json").read_text())
    cos, sin = np.cos(model["Rot"]), np.sin(model["Rot"])
    grid = LensletGrid(
        origin_px=(model["HOffset"] - 1, model["VOffset"] - 1),
        step_u_px=(model["HSpacing"] * cos, model["HSpacing"] * sin),
        step_v_px=(-model["VSpacing"] * sin, model["VSpacing"] * cos),
        first_shifted_row=int(model["FirstPosShiftRow"]) - 1,
        rows=int(model["VMax"]),
        columns=int(model["UMax"]),
        sensor_shape=(600, 600),
        residual_px=0.0,
        quality=1.0,
        source="given",
    )
    monkeypatch.setattr(decoder, "_quantise", lambda values: None)
    _, weight = decoder.sample_as_lftoolbox(photo, white, grid)
    error = np.abs(resample_rays(weight[..., None], measured, requested)[..., 0] - reference[..., 3])
    assert np.mean(error > 1e-5) < 1e-3
    assert np.sqrt(np.mean(error**2)) < 0.29 * CODE


def test_default_target_is_the_toolbox_s(
    toolbox: tuple[np.ndarray, ToolboxIntrinsics, np.ndarray, np.ndarray],
) -> None:
    decoded, measured, requested, _ = toolbox
    t, s, v, u = decoded.shape[:4]
    np.testing.assert_allclose(requested_intrinsics(measured, (t, s, v, u)), requested, rtol=0, atol=1e-12)


def field(shape: tuple[int, int, int, int] = (3, 3, 8, 9)) -> LightField:
    """A ramp in all four directions, which linear interpolation keeps."""
    t, s, v, u = np.meshgrid(*[np.arange(n) for n in shape], indexing="ij")
    ramp = 0.05 * t + 0.02 * s + 0.03 * v + 0.04 * u
    views = np.stack([ramp, ramp / 2, ramp / 3], axis=-1).astype(np.float32)
    return LightField(views, np.full(shape, 200, np.uint8), None, "A1", "ramp")


def test_same_intrinsics_change_nothing() -> None:
    before = field()
    after = rectify_as_lftoolbox(before, STRAIGHT)
    np.testing.assert_allclose(after.views, before.views, atol=1e-6)
    assert after.weight is not None and np.all(after.weight == 200)
    assert after.serial == "A1"


def test_shifted_target_reads_shifted_samples() -> None:
    requested = H.copy()
    requested[2, 4] += 0.5 * H[2, 2]  # Half a sample to the right along u: 0.5 * 0.04.
    after = rectify_as_lftoolbox(field(), STRAIGHT, requested)
    np.testing.assert_allclose(after.views[..., :8, 0], field().views[..., :8, 0] + 0.02, atol=1e-6)
    assert after.weight is not None
    assert not after.weight[..., 8].any() and not after.views[..., 8, :].any(), "nothing was captured there"


def test_distortion_is_centred_on_the_bias() -> None:
    """The direction at the bias stays; another moves by two steps of the fixed point, here done by hand."""
    bias = H[2, 2] * 2  # At u = 6.
    bent = ToolboxIntrinsics(H, np.array([5.0, 0, 0, bias, H[3, 3] * -0.5]))  # And v = 3.
    ramp = np.broadcast_to(np.arange(9.0, dtype=np.float32)[:, None], (3, 3, 8, 9, 1)).copy()
    found = resample_rays(ramp, bent, H)
    assert found[1, 1, 3, 6, 0] == pytest.approx(6.0, abs=1e-5)
    ideal = -3 * H[2, 2]
    step = ideal / (1 + 5 * ideal**2)
    step = ideal / (1 + 5 * step**2)
    assert found[1, 1, 3, 3, 0] == pytest.approx(6 + step / H[2, 2], abs=1e-5)


@pytest.mark.parametrize(
    ("matrix", "distortion", "message"),
    [
        (H[:4], np.zeros(5), "matrix has shape"),
        (H, np.zeros(3), "distortion has shape"),
        (H, np.full(5, np.nan), "finite numbers"),
    ],
)
def test_refuses_other_shapes(matrix: np.ndarray, distortion: np.ndarray, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        ToolboxIntrinsics(matrix, distortion)


def test_refuses_intrinsics_without_rays() -> None:
    with pytest.raises(RigError, match="no inverse"):
        ToolboxIntrinsics(np.zeros((5, 5)), np.zeros(5))


def test_refuses_another_target() -> None:
    with pytest.raises(ShapeError, match="requested intrinsics"):
        rectify_as_lftoolbox(field(), STRAIGHT, H[:4, :4])
