"""Drift of a rig: a known turn is found again from points that both cameras see, and from painted scenes."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lfstereo.cli.main import main
from lfstereo.errors import RigError, TargetNotFoundError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import write_light_field
from lfstereo.rig.drift import Drift, estimate_drift, moved_rig, row_parallax_px
from lfstereo.rig.features import FeatureMatches, match_features
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import PlenopticCamera, StereoRig, read_rig, write_rig

LEFT = PlenopticCamera("L", (420, 300), (780.0, 780.0), (211.0, 148.0), 0.85, 8e-4, (-0.1, 0.0, 0.0, 0.0, 0.0))
RIGHT = PlenopticCamera("R", (420, 300), (784.0, 784.0), (208.0, 152.5), 0.85, 8e-4)
RIG = StereoRig(LEFT, RIGHT, (0.003, 0.11, -0.004), (-0.0948, 0.0006, 0.0052), 0.6, 1.2, 1.0)
NOISE_PX = 0.1
DRIFT = np.array([math.radians(0.1), math.radians(-0.2), math.radians(0.15), 0.0008])
PAINTED_TOLERANCE_RAD = np.radians([0.01, 0.1, 0.02])
"""Of pitch, yaw and roll from a few hundred features; the yaw shows in the corners alone."""


def known_matches(rig: StereoRig, count: int = 600, wrong: int = 0, seed: int = 3) -> FeatureMatches:
    rng = np.random.default_rng(seed)
    z = 1 / rng.uniform(1 / 1.2, 1 / 0.6, count)
    points = np.stack([z * rng.uniform(-0.2, 0.25, count) + 0.03, z * rng.uniform(-0.17, 0.17, count), z], axis=1)
    right = points @ rig.right_from_left.T + rig.translation_m
    noise = rng.normal(0, NOISE_PX / 780, (2, count, 2))
    noise[1, :wrong] += rng.uniform(-20, 20, (wrong, 2)) / 780
    return FeatureMatches(points[:, :2] / points[:, 2:] + noise[0], right[:, :2] / right[:, 2:] + noise[1])


def in_deviations(found: Drift, truth: np.ndarray) -> np.ndarray:
    misses = np.concatenate([found.rotation_rad, [found.height_m]]) - truth
    return misses / np.concatenate([found.rotation_sd_rad, [found.height_sd_m]])


def test_without_noise_the_rows_agree_for_the_true_rig() -> None:
    matches = known_matches(RIG, count=50)
    quiet = FeatureMatches(matches.left, matches.left)
    assert np.abs(row_parallax_px(RIG, matches)).max() < 6 * NOISE_PX
    assert np.abs(row_parallax_px(RIG, quiet)).max() > 1.0


@pytest.mark.parametrize("wrong", [0, 120])
def test_a_known_drift_is_found_within_its_deviations(wrong: int) -> None:
    now = moved_rig(RIG, DRIFT)
    found = estimate_drift(RIG, known_matches(now, wrong=wrong))
    assert np.abs(in_deviations(found, DRIFT)).max() < 4
    assert found.rotation_sd_rad.max() < math.radians(0.05)
    assert found.height_sd_m < 0.2e-3
    assert found.moved
    assert found.parallax_px < 2 * NOISE_PX < found.moved_px
    assert found.rig.baseline_m == pytest.approx(RIG.baseline_m, rel=1e-12)
    turn = Rotation.from_matrix(found.rig.right_from_left @ now.right_from_left.T).magnitude()
    assert turn < math.radians(0.05)
    assert found.matches <= 600 - 0.7 * wrong


def test_a_rig_that_stayed_has_not_moved() -> None:
    found = estimate_drift(RIG, known_matches(RIG))
    assert not found.moved
    assert np.abs(in_deviations(found, np.zeros(4))).max() < 4
    assert found.moved_px < 0.1


def test_a_change_too_small_to_matter_has_not_moved_the_rig() -> None:
    found = estimate_drift(RIG, known_matches(moved_rig(RIG, np.array([1e-4, 0, 0, 0])), count=4000))
    assert found.rotation_rad[0] == pytest.approx(1e-4, abs=3e-5)
    assert not found.moved


def test_refuses_matches_that_contradict_each_other() -> None:
    matches = known_matches(RIG, count=40)
    mixed = FeatureMatches(matches.left, matches.right + np.linspace(-0.02, 0.02, 40)[:, None])
    with pytest.raises(RigError, match="features agree with each other, expected 30 or more"):
        estimate_drift(RIG, FeatureMatches(mixed.left[:25], mixed.right[:25]))


def painted(camera: PlenopticCamera, rig: StereoRig, tilt: float, name: str) -> LightField:
    """Photograph a tilted wall of random texture at 0.85 m by the camera's centre view."""
    rng = np.random.default_rng(0)
    coarse = cv2.resize(rng.random((150, 200)).astype(np.float32), (1600, 1200), interpolation=cv2.INTER_CUBIC)
    wall = 0.5 * coarse + 0.5 * cv2.GaussianBlur(rng.random((1200, 1600)).astype(np.float32), (0, 0), 2.5)
    axes = Rotation.from_rotvec([tilt, 0.3, 0]).as_matrix()
    step = 0.8e-3
    in_left = np.column_stack([step * axes[:, 0], step * axes[:, 1], [0.04, 0, 0.85] - step * axes @ [800, 600, 0]])
    plane = in_left if camera is rig.left else rig.right_from_left @ in_left + np.outer(rig.translation_m, [0, 0, 1])
    width, height = camera.sensor_px
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    x, y = (column - camera.principal_px[0]) / camera.focal_px[0], (row - camera.principal_px[1]) / camera.focal_px[1]
    r2 = x**2 + y**2
    for _ in range(6):  # directions of a lens with k1 alone
        r2 = (x**2 + y**2) / (1 + camera.distortion[0] * r2) ** 2
    gain = 1 / (1 + camera.distortion[0] * r2)
    seen = np.stack([x * gain, y * gain, np.ones_like(x)], axis=-1) @ np.linalg.inv(plane).T
    at = (seen[..., :2] / seen[..., 2:]).astype(np.float32)
    picture = cv2.remap(wall, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    return LightField(np.repeat(picture[None, None, ..., None], 3, axis=-1), None, None, camera.serial, name)


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drift")
    now = moved_rig(RIG, DRIFT)
    for n, tilt in enumerate((0.35, -0.35)):
        for side, camera in (("left", now.left), ("right", now.right)):
            write_light_field(folder / f"{n}_{side}.h5", painted(camera, now, tilt, f"{n} {side}"))
    write_rig(folder / "rig.toml", RIG)
    write_rig(folder / "now.toml", now)
    return folder


def words(folder: Path, rig: str, *more: str) -> list[str]:
    captures = [str(folder / f"{n}_{side}.h5") for n in (0, 1) for side in ("left", "right")]
    return ["calibrate", "--refine", str(folder / rig), *captures, *more]


def test_refine_finds_the_drift_and_writes_the_rig(
    photographs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "refined.toml"
    assert main(words(photographs, "rig.toml", "--json", "-o", str(output))) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["moved"] and summary["captures"] == 2
    miss = np.abs(np.array(summary["rotation_rad"]) - DRIFT[:3])
    assert np.all(miss < PAINTED_TOLERANCE_RAD), np.degrees(miss)
    assert summary["height_m"] == pytest.approx(DRIFT[3], abs=0.2e-3)
    assert summary["row_parallax_px"][1] < 0.3 < summary["row_parallax_px"][0]
    assert read_rig(output).left == LEFT


def test_refine_says_that_a_rig_has_not_moved(photographs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "--refine", str(photographs / "now.toml"), str(photographs)]) == 0
    assert "the rig has not moved" in capsys.readouterr().out


def test_refine_says_that_a_rig_has_moved(photographs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words(photographs, "rig.toml")) == 0
    told = capsys.readouterr().out
    assert "the rig has MOVED" in told and "write the rig as it is now with -o" in told


def test_refine_refuses_captures_that_do_not_fit(
    photographs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = str(photographs / "0_left.h5"), str(photographs / "0_right.h5")
    refine = ["calibrate", "--refine", str(photographs / "rig.toml")]
    assert main([*refine, right, left]) == 3
    assert "taken by camera #be43, but the rig's left camera is #304b" in capsys.readouterr().err
    assert main([*refine, left, right, left]) == 3
    assert "found 3 captures, expected left and right in turn" in capsys.readouterr().err
    assert main([*refine, left, str(tmp_path / "none.h5")]) == 3
    assert "none.h5: found no such file" in capsys.readouterr().err


def test_pictures_without_common_features_are_refused() -> None:
    plain = LightField(np.full((1, 1, 300, 420, 3), 0.4, np.float32), None, None, "", "plain")
    with pytest.raises(TargetNotFoundError, match="plain and plain: found 0 matching features, expected 30"):
        match_features(plain, dataclasses.replace(plain), RIG, rectified_geometry(RIG))
