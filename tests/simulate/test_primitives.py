"""Rays against each kind of primitive, and the scene's change of axes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lfstereo.simulate.pinhole import Pinhole, depth, render, visible
from lfstereo.simulate.primitives import (
    BOX,
    CYLINDER,
    DISC,
    ELLIPSOID,
    FAR_AWAY,
    LATTICE,
    LEAF,
    PATCH,
    RING,
    extents,
    hit,
    local_normal,
)
from lfstereo.simulate.scene import Scene, Surface, even_light, linear_rgb, primitive
from lfstereo.simulate.texture import (
    BOOK,
    BRICK,
    CHECKER,
    DOTS,
    GLOBE,
    LANDSCAPE,
    LEAF_VEINS,
    MARBLE,
    MOTTLED,
    PRINT,
    STRIPE,
    TERRAZZO,
    WEAVE,
    WOOD,
    surface_colour,
)

PAINT = Surface(CHECKER, ("#ff0000", "#00ff00", "#0000ff"), 0.02)
EYE = np.eye(3)
AHEAD = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def one(kind: int, half: tuple[float, float, float], **more: object) -> np.ndarray:
    return primitive(kind, (0.0, 0.0, 1.0), EYE, half, PAINT, **more)[None]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (one(PATCH, (0.1, 0.1, 1)), 1.0),
        (one(BOX, (0.1, 0.1, 0.25)), 0.75),
        (one(ELLIPSOID, (0.1, 0.2, 0.3)), 0.7),
        (one(CYLINDER, (0.2, 0.1, 1)), 0.8),
    ],
)
def test_head_on_distance(scene: np.ndarray, expected: float) -> None:
    assert hit(scene, 0, *AHEAD) == pytest.approx(expected, rel=1e-9)
    assert hit(scene, 0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0) == FAR_AWAY


def test_curved_patch_bends_by_its_curvature() -> None:
    scene = one(PATCH, (0.1, 0.1, 1), curve=(2.0, -4.0))
    at = (0.05, 0.08)
    expected = 1 + 0.5 * (2.0 * at[0] ** 2 - 4.0 * at[1] ** 2)
    assert hit(scene, 0, *at, 0.0, 0.0, 0.0, 1.0) == pytest.approx(expected, rel=1e-9)


def test_tapered_cylinder_is_wider_below() -> None:
    scene = one(CYLINDER, (0.1, 0.1, 1), curve=(0.5, 0.0))
    assert hit(scene, 0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0) == pytest.approx(1 - 0.125, rel=1e-9)
    assert hit(scene, 0, 0.0, -0.05, 0.0, 0.0, 0.0, 1.0) == pytest.approx(1 - 0.075, rel=1e-9)


def test_hollow_cylinder_shows_its_inside() -> None:
    scene = one(CYLINDER, (0.1, 0.1, 1), curve=(0.0, 1.0))
    # From above, steeply: past the rim in front onto the far wall inside.
    assert hit(scene, 0, 0.0, -0.2, 0.9, 0.0, 0.9, 1.0) == pytest.approx(0.2, rel=1e-9)


@pytest.mark.parametrize(
    ("outline", "inside", "outside"),
    [
        (DISC, (0.06, 0.06), (0.08, 0.08)),
        (RING, (0.09, 0.0), (0.05, 0.0)),
        (LEAF, (0.0, 0.09), (0.08, 0.06)),
        (LATTICE, (-0.1, 0.0), (0.0, 0.0)),
    ],
)
def test_outlines(outline: int, inside: tuple[float, float], outside: tuple[float, float]) -> None:
    scene = one(PATCH, (0.1, 0.1, 0.08), outline=outline)
    assert hit(scene, 0, *inside, 0.0, 0.0, 0.0, 1.0) == pytest.approx(1.0)
    if outline != LATTICE:
        assert hit(scene, 0, *outside, 0.0, 0.0, 0.0, 1.0) == FAR_AWAY
    else:
        middle_of_cell = -0.1 + 0.5 * 0.08
        assert hit(scene, 0, middle_of_cell, middle_of_cell, 0.0, 0.0, 0.0, 1.0) == FAR_AWAY


@pytest.mark.parametrize("kind", [PATCH, BOX, ELLIPSOID, CYLINDER])
def test_hits_lie_inside_the_extents_and_normals_have_unit_length(kind: int) -> None:
    rng = np.random.default_rng(kind)
    axes = Rotation.from_rotvec([0.4, -0.7, 0.3]).as_matrix()
    row = primitive(kind, (0.02, -0.03, 1.0), axes, (0.1, 0.15, 0.07), PAINT, curve=(0.3, 0.4))
    size = extents(row[None])[0]
    hits = 0
    for dx, dy in rng.uniform(-0.2, 0.2, (400, 2)):
        t = hit(row[None], 0, 0.0, 0.0, 0.0, dx, dy, 1.0)
        if t == FAR_AWAY:
            continue
        hits += 1
        local = np.array([dx, dy, 1.0]) * t - (0.02, -0.03, 1.0)
        assert np.all(np.abs(local) <= size)
        assert np.linalg.norm(local_normal(row[None], 0, *(axes @ local))) == pytest.approx(1.0, rel=1e-6)
    assert hits > 40


def test_change_of_axes_moves_everything_alike() -> None:
    rows = [one(ELLIPSOID, (0.1, 0.12, 0.1))[0], one(BOX, (0.04, 0.2, 0.03))[0]]
    scene = Scene(np.stack(rows), even_light(), np.ones((1, 2, 2), np.float32))
    turn, shift = Rotation.from_rotvec([0.02, -0.03, 0.4]).as_matrix(), np.array([0.01, 0.02, 0.1])
    moved = scene.seen_from(turn, shift)
    direction = np.array([0.03, 0.02, 1.0])
    for index in (0, 1):
        t = hit(scene.primitives, index, 0.0, 0.0, 0.0, *direction)
        assert hit(moved.primitives, index, *shift, *(turn @ direction)) == pytest.approx(t, rel=1e-9)


def test_pinhole_renders_depth_and_colour() -> None:
    surface = Surface(BRICK, ("#804020", "#804020", "#804020"), 0.02, 0.0)
    row = primitive(PATCH, (0.0, 0.0, 0.8), EYE, (1.0, 1.0, 1.0), surface)
    scene = Scene(row[None], even_light(), np.ones((1, 2, 2), np.float32))
    view = Pinhole(100.0, (9.5, 4.5), (10, 20))
    np.testing.assert_allclose(depth(scene, view), 0.8, rtol=1e-6)
    picture = render(scene, view, 2)
    ratio = picture / linear_rgb("#804020")
    np.testing.assert_allclose(ratio, ratio[..., :1] * np.ones(3), rtol=1e-5)
    assert visible(scene, np.array([[0.0, 0.0, 0.7], [0.0, 0.0, 0.9]]), np.zeros(3), 1e-4).tolist() == [True, False]


@pytest.mark.parametrize(
    "texture",
    [
        BOOK,
        BRICK,
        CHECKER,
        DOTS,
        GLOBE,
        LANDSCAPE,
        LEAF_VEINS,
        MARBLE,
        MOTTLED,
        PRINT,
        STRIPE,
        TERRAZZO,
        WEAVE,
        WOOD,
    ],
)
@pytest.mark.parametrize("kind", [PATCH, BOX, ELLIPSOID, CYLINDER])
def test_patterns_are_reflectances_with_contrast(texture: int, kind: int) -> None:
    surface = Surface(texture, ("#a04030", "#e0d0b0", "#304050"), 0.02, 0.3, 5)
    scene = primitive(kind, (0.0, 0.0, 1.0), EYE, (0.1, 0.1, 0.1), surface)[None]
    rng = np.random.default_rng(texture)
    points = rng.normal(size=(300, 3))
    points /= 10 * np.linalg.norm(points, axis=1, keepdims=True)
    colours = np.array([surface_colour(scene, 0, *p, 0.0005) for p in points])
    assert np.all(np.isfinite(colours))
    assert colours.min() >= 0
    assert colours.max() < 1.4
    assert colours.std(axis=0).max() > 0.01


def test_patterns_finer_than_the_spot_fade() -> None:
    surface = Surface(MOTTLED, ("#000000", "#ffffff", "#ffffff"), 0.002, 0.0, 5)
    scene = one(PATCH, (0.1, 0.1, 1.0))
    scene[0] = primitive(PATCH, (0.0, 0.0, 1.0), EYE, (0.1, 0.1, 1.0), surface)
    points = np.random.default_rng(1).uniform(-0.1, 0.1, (200, 2))
    fine, coarse = (np.std([surface_colour(scene, 0, *p, 0.0, s)[0] for p in points]) for s in (0.0005, 0.01))
    assert coarse < 0.05 * fine
