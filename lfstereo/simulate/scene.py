"""The value that a rendering starts from: primitives, light and baked shadows in the axes of one camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.simulate.primitives import (
    AXES,
    CENTRE,
    COLOURS,
    CURVE,
    DETAIL,
    HALF,
    KIND,
    LIGHT_MAP,
    OUTLINE,
    PATCH,
    PATTERN_SEED,
    RECTANGLE,
    SCALE,
    SLOTS,
    TEXTURE,
    extents,
)
from lfstereo.simulate.shade import AMBIENT, CONTACT, FLOOR, KEY, LIGHT_SLOTS, TOWARDS_LIGHT, bake
from lfstereo.simulate.texture import MOTTLED, PLAIN

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Surface:
    """What a primitive is painted with."""

    texture: int
    """One of the patterns of ``texture``."""
    colours: tuple[str, str, str]
    """Three sRGB colours as ``#rrggbb``; what they mean is the pattern's."""
    scale_m: float
    """Size of the pattern's element."""
    detail: float = 0.25
    """Strength of fine mottling on top, 0..1."""
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Scene:
    """Primitives and light, all in the axes of one camera, m."""

    primitives: Float64
    """``(N, SLOTS)``, see ``primitives``."""
    light: Float64
    """``(LIGHT_SLOTS,)``, see ``shade``."""
    light_maps: Float32
    """``(L, S, S)`` share of the light that places of flat patches see."""

    @property
    def extents(self) -> Float64:
        """Half the size of an upright box about each primitive, ``(N, 3)``."""
        return extents(self.primitives)

    def seen_from(self, rotation: Float64, translation_m: Float64) -> Scene:
        """Return the scene in other axes: ``X_new = R X + t``."""
        primitives, light = self.primitives.copy(), self.light.copy()
        primitives[:, CENTRE : CENTRE + 3] = primitives[:, CENTRE : CENTRE + 3] @ rotation.T + translation_m
        axes = primitives[:, AXES : AXES + 9].reshape(-1, 3, 3) @ rotation.T
        primitives[:, AXES : AXES + 9] = axes.reshape(-1, 9)
        light[TOWARDS_LIGHT : TOWARDS_LIGHT + 3] = rotation @ light[TOWARDS_LIGHT : TOWARDS_LIGHT + 3]
        normal = rotation @ light[FLOOR : FLOOR + 3]
        light[FLOOR : FLOOR + 3] = normal
        light[FLOOR + 3] += normal @ translation_m
        return replace(self, primitives=primitives, light=light)


def linear_rgb(colour: str) -> Float64:
    """Return the linear RGB of an sRGB colour ``#rrggbb``.

    References
    ----------
    IEC 61966-2-1:1999, the sRGB transfer function.

    Examples
    --------
    >>> linear_rgb("#ff0080").round(4).tolist()
    [1.0, 0.0, 0.2159]
    """
    encoded = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    linear: Float64 = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear


def primitive(
    kind: int,
    centre: Float64 | Vector,
    axes: Float64,
    half: Vector,
    surface: Surface,
    curve: tuple[float, float] = (0.0, 0.0),
    outline: int = RECTANGLE,
) -> Float64:
    """Return one primitive as a row.

    Parameters
    ----------
    axes
        ``(3, 3)``, rows are the local x, y, z axes.
    half
        Half extents, m; see ``primitives.HALF``.
    """
    row = np.zeros(SLOTS)
    row[KIND], row[CENTRE : CENTRE + 3], row[AXES : AXES + 9] = kind, centre, np.asarray(axes).ravel()
    row[HALF : HALF + 3], row[CURVE : CURVE + 2], row[OUTLINE] = half, curve, outline
    row[TEXTURE], row[SCALE], row[DETAIL] = surface.texture, surface.scale_m, surface.detail
    row[COLOURS : COLOURS + 9] = np.concatenate([linear_rgb(c) for c in surface.colours])
    row[LIGHT_MAP], row[PATTERN_SEED] = -1, surface.seed
    return row


def even_light() -> Float64:
    """Return light that shows every surface with its bare reflectance."""
    light = np.zeros(LIGHT_SLOTS)
    light[AMBIENT : AMBIENT + 3] = 1.0
    light[TOWARDS_LIGHT + 2] = -1.0
    return light


def room_light(towards: Vector, floor: tuple[float, float, float, float], contact_m: float) -> Float64:
    """Return a warm key light from one side over cool light from everywhere."""
    light = np.zeros(LIGHT_SLOTS)
    light[TOWARDS_LIGHT : TOWARDS_LIGHT + 3] = np.asarray(towards) / np.linalg.norm(towards)
    light[KEY : KEY + 3] = 0.70, 0.65, 0.58
    light[AMBIENT : AMBIENT + 3] = 0.30, 0.325, 0.36
    light[FLOOR : FLOOR + 4], light[CONTACT] = floor, contact_m
    return light


def with_shadows(primitives: Float64, light: Float64, receivers: tuple[int, ...], size: int = 128) -> Scene:
    """Return a scene whose given flat patches carry the soft shadows of everything else."""
    painted = primitives.copy()
    painted[list(receivers), LIGHT_MAP] = range(len(receivers))
    maps = [bake(painted, light, which, size, 36, 0.16) for which in receivers]
    return Scene(painted, light, np.stack(maps))


def card(distance_m: float, half_m: float, colour: str = "#808080", texture: int = PLAIN) -> Scene:
    """Return a flat card across the optical axis under even light, for tests and measurements."""
    surface = Surface(texture, (colour, "#202020", "#e0e0e0"), 0.01, detail=0.5 * (texture == MOTTLED))
    row = primitive(PATCH, (0.0, 0.0, distance_m), np.eye(3), (half_m, half_m, 1.0), surface)
    return Scene(row[None], even_light(), np.ones((1, 2, 2), np.float32))
