"""Furnished scenes and the textures they are dressed in."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.training.atlas import COMPOSITES, PHOTOGRAPHS, mixed_bank, scene_bank
from lfstereo.training.rooms import SCENES, room_scene
from lfstereo.training.samples import pair_sample
from lfstereo.training.scenes import render
from lfstereo.training.textures import texture_bank

HEIGHT, WIDTH = 64, 96


@pytest.fixture(scope="module")
def bank() -> np.ndarray:
    return texture_bank(5, 6)


@pytest.mark.parametrize("seed", range(8))
def test_rooms_stay_within_the_disparity_range(seed: int, bank: np.ndarray) -> None:
    scene = room_scene(np.random.default_rng(seed), bank, HEIGHT, WIDTH)
    assert 9 <= len(scene.layers) <= 6 + 2 * 8 + 55
    disparity = render(scene, 0, 0).disparity
    assert disparity.min() > -15 and disparity.max() < 125  # px; walls may leave the range a little at the corners
    assert np.ptp(disparity) > 5


def test_the_right_eye_sees_the_same_room(bank: np.ndarray) -> None:
    """Where both see a place, the right picture holds the left one's colour at x - d."""
    scene = room_scene(np.random.default_rng(3), bank, HEIGHT, WIDTH)
    left, right = render(scene, 0, 0), render(scene, 1, 0)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    match = np.rint(x - left.disparity).astype(int)
    inside = match >= 0
    same = right.layer[y, match.clip(0)] == left.layer
    other = right.disparity[y, match.clip(0)]
    seen = inside & same
    assert seen.mean() > 0.3
    assert np.abs(other - left.disparity)[seen].mean() < 0.6  # px; half a px of rounding on slanted walls


def test_kinds_of_scenes_give_pairs(bank: np.ndarray) -> None:
    pairs = {kind: pair_sample(np.random.default_rng(2), bank, HEIGHT, WIDTH, kind) for kind in SCENES}
    assert all(pair.left.shape == (HEIGHT, WIDTH, 3) for pair in pairs.values())
    assert not np.array_equal(pairs["rooms"].disparity, pairs["layers"].disparity)


def test_some_textures_come_from_photographs(tmp_path: Path) -> None:
    red = np.zeros((80, 120, 3), np.uint8)
    red[..., 2] = 255
    cv2.imwrite(str(tmp_path / "red.png"), red)
    with_photographs, without = mixed_bank(3, 40, str(tmp_path)), mixed_bank(3, 40)
    one_channel = [(t.reshape(-1, 3).max(0) > 0.99).sum() == 1 and np.median(t) == 0 for t in with_photographs]
    share = np.mean(one_channel)
    assert abs(share - PHOTOGRAPHS) < 0.25
    changed = np.mean([not np.array_equal(a, b) for a, b in zip(without, texture_bank(3, 40), strict=True)])
    assert abs(changed - COMPOSITES) < 0.2
    assert np.array_equal(scene_bank("layers", 3, 4), texture_bank(3, 4))


def test_a_folder_without_photographs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="holds no PNG or JPEG picture"):
        mixed_bank(1, 4, str(tmp_path / "none"))
