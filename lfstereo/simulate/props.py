"""Things to put on the table of a simulated scene, each a handful of primitives.

Every function takes the place where the thing stands, its size and a random generator, and returns primitive rows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.simulate import texture as paint
from lfstereo.simulate.primitives import BOX, CYLINDER, DISC, ELLIPSOID, LATTICE, LEAF, PATCH, RING
from lfstereo.simulate.scene import Surface, primitive

Rows = list[Float64]
EARTHS = ("#a4553a", "#c98b5e", "#7d5a44", "#d8b48a", "#8a8f5a", "#b4763c")
BRIGHTS = ("#b23a34", "#d99a2b", "#3c6e91", "#4f8a5b", "#8c4f78", "#d3693f", "#2f7f86", "#c7b13d")
PALES = ("#e9e2d0", "#dcd6c4", "#efe9df", "#d6dde0")
DARKS = ("#2d3138", "#3a2a22", "#24333a", "#40252b")


@dataclass(frozen=True, slots=True)
class Stand:
    """A place on the table."""

    foot: Float64
    """``(3,)`` the point where the thing stands, m."""
    axes: Float64
    """``(3, 3)``, rows: across, down, away; "up" is minus the second."""
    size: float
    """Height or so of the thing, m."""

    def at(self, x: float, up: float, z: float) -> Float64:
        """Return a point given across, up and away from the foot, m."""
        point: Float64 = self.foot + np.array([x, -up, z]) @ self.axes
        return point

    def turned(self, angle_rad: float) -> Float64:
        """Return the axes turned about the vertical."""
        c, s = math.cos(angle_rad), math.sin(angle_rad)
        axes: Float64 = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ self.axes
        return axes


def pick(rng: np.random.Generator, colours: tuple[str, ...]) -> str:
    """Return one of the colours."""
    return colours[int(rng.integers(len(colours)))]


def two(rng: np.random.Generator, colours: tuple[str, ...]) -> tuple[str, str]:
    """Return two different ones of the colours."""
    first, second = rng.choice(len(colours), 2, replace=False)
    return colours[int(first)], colours[int(second)]


def rod(start: Float64, end: Float64, radius: float, surface: Surface) -> Float64:
    """Return a thin rod between two points."""
    along = (end - start) / np.linalg.norm(end - start)
    across = np.cross(along, [0.3, 0.1, 1.0])
    across /= np.linalg.norm(across)
    axes = np.stack([across, along, np.cross(across, along)])
    length = float(np.linalg.norm(end - start))
    return primitive(CYLINDER, (start + end) / 2, axes, (radius, length / 2, 1.0), surface)


def _surface(rng: np.random.Generator, size: float) -> Surface:
    """Return the glaze of a pot, ball or vase."""
    seed = int(rng.integers(1, 10000))
    a, b = two(rng, BRIGHTS + EARTHS)
    pale = pick(rng, PALES)
    choices = (
        Surface(paint.TERRAZZO, (pale, a, b), 0.16 * size, 0.2, seed),
        Surface(paint.STRIPE, (pale, a, b), 0.2 * size, 0.25, seed),
        Surface(paint.MARBLE, (a, pick(rng, DARKS), pale), 0.35 * size, 0.2, seed),
        Surface(paint.CHECKER, (a, pale, b), 0.17 * size, 0.3, seed),
        Surface(paint.DOTS, (a, pale, b), 0.22 * size, 0.25, seed),
        Surface(paint.MOTTLED, (a, b, pale), 0.3 * size, 0.35, seed),
    )
    return choices[int(rng.integers(len(choices)))]


def ball(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a painted ball or egg."""
    r = 0.5 * stand.size
    tall = r * rng.uniform(0.85, 1.0)
    turn = stand.turned(rng.uniform(-1, 1))
    return [primitive(ELLIPSOID, stand.at(0, tall, 0), turn, (r, tall, r), _surface(rng, stand.size))]


def globe(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a globe on a foot."""
    h = stand.size
    seed = int(rng.integers(1, 10000))
    sphere = Surface(paint.GLOBE, ("#2f6f9a", "#7e9a52", "#c9a265"), 0.3 * h, 0.2, seed)
    wood = Surface(paint.WOOD, ("#8a5a34", "#5d3820", "#b07a48"), 0.05 * h, 0.2, seed)
    return [
        primitive(ELLIPSOID, stand.at(0, 0.62 * h, 0), stand.turned(rng.uniform(-3, 3)), (0.38 * h,) * 3, sphere),
        primitive(CYLINDER, stand.at(0, 0.03 * h, 0), stand.axes, (0.24 * h, 0.03 * h, 1), wood),
        rod(stand.at(0, 0.05 * h, 0), stand.at(0, 0.26 * h, 0), 0.03 * h, wood),
    ]


def books(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a pile of books with a fruit on top."""
    rows, level = [], 0.0
    for _ in range(int(rng.integers(3, 5))):
        thick = stand.size * rng.uniform(0.14, 0.22)
        half = (stand.size * rng.uniform(0.5, 0.62), thick / 2, stand.size * rng.uniform(0.34, 0.42))
        cover, trim = pick(rng, BRIGHTS + DARKS), pick(rng, (*PALES, "#d9b45a"))
        surface = Surface(paint.BOOK, (cover, trim, "#e6dcc2"), 0.1 * stand.size, 0.22, int(rng.integers(1, 999)))
        turn = stand.turned(rng.uniform(-0.45, 0.45))
        rows.append(primitive(BOX, stand.at(0, level + thick / 2, 0), turn, half, surface))
        level += thick
    r = 0.17 * stand.size
    skin = Surface(paint.MOTTLED, (pick(rng, ("#a8322a", "#c9a52c", "#7f9a3a")), "#d98a3a", "#5a3a20"), 0.6 * r, 0.2)
    rows.append(
        primitive(ELLIPSOID, stand.at(0.1 * stand.size, level + 0.92 * r, 0), stand.axes, (r, 0.92 * r, r), skin)
    )
    stalk = Surface(paint.PLAIN, ("#4a3522",) * 3, 0.01, 0)
    tip = stand.at(0.13 * stand.size, level + 2.5 * r, 0)
    rows.append(rod(stand.at(0.1 * stand.size, level + 1.7 * r, 0), tip, 0.06 * r, stalk))
    return rows


def blocks(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a tower of toy blocks."""
    rows, level = [], 0.0
    for share in (0.42, 0.33, 0.25):
        side = share * stand.size * rng.uniform(0.95, 1.05)
        place = stand.at(rng.uniform(-0.1, 0.1) * side, level + side / 2, 0)
        turn = stand.turned(rng.uniform(-0.7, 0.7))
        rows.append(primitive(BOX, place, turn, (side / 2,) * 3, _surface(rng, 1.3 * side)))
        level += side
    return rows


def vase(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a vase with twigs and berries."""
    h = 0.55 * stand.size
    glaze = _surface(rng, h)
    rows = [
        primitive(
            ELLIPSOID, stand.at(0, 0.36 * h, 0), stand.turned(rng.uniform(-1, 1)), (0.34 * h, 0.36 * h, 0.34 * h), glaze
        ),
        primitive(CYLINDER, stand.at(0, 0.8 * h, 0), stand.axes, (0.16 * h, 0.2 * h, 1), glaze, curve=(-0.25, 1.0)),
    ]
    bark = Surface(paint.MOTTLED, ("#4b3626", "#7a5a3e", "#2c2018"), 0.02 * h, 0.2)
    berry = Surface(paint.MOTTLED, (pick(rng, ("#b8322c", "#d98f2b", "#7b3f6e")), "#e0b070", "#401810"), 0.03 * h, 0.2)
    for k in range(5):
        lean, away = (k - 2) * 0.16 + rng.uniform(-0.05, 0.05), rng.uniform(-0.12, 0.12)
        low = stand.at(0, 0.9 * h, 0)
        middle = stand.at(lean * h, 1.4 * h, away * h)
        top = stand.at(1.9 * lean * h, h * rng.uniform(1.65, 1.9), 1.6 * away * h)
        rows += [rod(low, middle, 0.011 * h, bark), rod(middle, top, 0.008 * h, bark)]
        for share in (0.25, 0.65, 1.0):
            spot = middle + share * (top - middle) + rng.normal(0, 0.015 * h, 3)
            rows.append(primitive(ELLIPSOID, spot, stand.axes, (0.04 * h,) * 3, berry))
    return rows


def plant(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a potted plant: stems and veined leaves."""
    h = stand.size
    pot = Surface(paint.STRIPE, (pick(rng, EARTHS), pick(rng, EARTHS), pick(rng, PALES)), 0.12 * h, 0.3, 5)
    soil = Surface(paint.MOTTLED, ("#2a1d14", "#4a3626", "#181008"), 0.02 * h, 0.5)
    rows = [
        primitive(CYLINDER, stand.at(0, 0.15 * h, 0), stand.axes, (0.17 * h, 0.15 * h, 1), pot, curve=(-0.25, 0.0)),
        primitive(CYLINDER, stand.at(0, 0.302 * h, 0), stand.axes, (0.19 * h, 0.004 * h, 1), soil),
    ]
    stem = Surface(paint.MOTTLED, ("#4c6b2f", "#6f8a42", "#2f4420"), 0.03 * h, 0.2)
    greens = (("#2f6b35", "#5f9a45", "#a8c27a"), ("#3f7a3c", "#86a84a", "#c4d39a"), ("#25543a", "#3f8a5a", "#9cc4a0"))
    green = greens[int(rng.integers(len(greens)))]
    for k in range(9):
        angle = 2.4 * k + rng.uniform(-0.3, 0.3)
        out, up = h * rng.uniform(0.2, 0.38), h * rng.uniform(0.5, 0.95)
        tip = stand.at(out * math.sin(angle), up, out * math.cos(angle))
        rows.append(rod(stand.at(0.03 * h * math.sin(angle), 0.3 * h, 0), tip, 0.008 * h, stem))
        rows.append(_leaf(stand, tip, angle, h * rng.uniform(0.15, 0.2), green, rng))
    return rows


def _leaf(
    stand: Stand, tip: Float64, angle: float, half: float, green: tuple[str, str, str], rng: np.random.Generator
) -> Float64:
    outward = np.array([math.sin(angle), 0.25 + rng.uniform(-0.3, 0.3), 0.4 * math.cos(angle)]) @ stand.axes
    outward /= np.linalg.norm(outward)
    facing = -stand.axes[2] - 0.8 * stand.axes[1] + rng.normal(0, 0.25, 3)
    facing -= outward * (facing @ outward)
    facing /= np.linalg.norm(facing)
    axes = np.stack([outward, np.cross(outward, facing), -facing])
    axes[1] *= np.sign(np.linalg.det(axes))
    surface = Surface(paint.LEAF_VEINS, green, 0.3 * half, 0.2, int(rng.integers(1, 999)))
    centre = tip + 0.8 * half * outward
    return primitive(
        PATCH, centre, axes, (half, 0.45 * half, 1.0), surface, curve=(0.9 / half * 0.5, 0.3 / half), outline=LEAF
    )


def mug(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a mug with pencils in it."""
    h = 0.5 * stand.size
    glaze = _surface(rng, h)
    side = float(rng.choice([-1.0, 1.0]))
    rows = [
        primitive(CYLINDER, stand.at(0, h / 2, 0), stand.axes, (0.36 * h, 0.5 * h, 1), glaze, curve=(0.0, 1.0)),
        primitive(
            PATCH, stand.at(side * 0.44 * h, 0.52 * h, 0), stand.axes, (0.24 * h, 0.3 * h, 1), glaze, outline=RING
        ),
    ]
    for k in range(6):
        angle = 1.05 * k + rng.uniform(-0.3, 0.3)
        foot = stand.at(0.2 * h * math.sin(angle + 2.6), 0.1 * h, 0.2 * h * math.cos(angle + 2.6))
        out = h * rng.uniform(0.34, 0.5)
        tip = stand.at(out * math.sin(angle), h * rng.uniform(1.55, 2.0), 0.5 * out * math.cos(angle))
        colour = pick(rng, BRIGHTS)
        paintwork = Surface(paint.STRIPE, (colour, colour, pick(rng, PALES)), 0.3 * h, 0.15)
        rows.append(rod(foot, tip, 0.035 * h, paintwork))
    return rows


def postcard(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a bent picture leaning backwards."""
    w, h = 0.56 * stand.size, 0.40 * stand.size
    skies = (("#7fb0d6", "#5d7f86", "#2f4a2c"), ("#e0a878", "#8a5a6a", "#3a2a40"), ("#9cc0c8", "#7a8a5a", "#40502a"))
    surface = Surface(paint.LANDSCAPE, skies[int(rng.integers(len(skies)))], 0.1 * w, 0.15, int(rng.integers(1, 999)))
    turn = stand.turned(rng.uniform(-0.4, 0.4))
    tilt = 0.28
    lean = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    bend = 0.5 * rng.choice([-1, 1]) / w
    return [primitive(PATCH, stand.at(0, h, 0), lean @ turn, (w, h, 1), surface, curve=(bend, 0.0))]


def page(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a standing, rolled sheet of print."""
    w, h = 0.42 * stand.size, 0.5 * stand.size
    surface = Surface(paint.PRINT, ("#e8e2d2", "#26262a", "#8a2f2a"), 0.085 * h, 0.12, int(rng.integers(1, 999)))
    turn = stand.turned(rng.uniform(-0.35, 0.35))
    return [primitive(PATCH, stand.at(0, h, 0), turn, (w, h, 1), surface, curve=(0.9 / w * rng.choice([-1, 1]), 0.0))]


def trellis(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a lattice of slats that one looks through."""
    w, h = 0.4 * stand.size, 0.5 * stand.size
    seed = int(rng.integers(1, 999))
    surface = Surface(paint.WOOD, ("#c9a274", "#8f6842", "#e0c098"), 0.04 * stand.size, 0.3, seed)
    turn = stand.turned(rng.uniform(-0.5, 0.5))
    panel = primitive(PATCH, stand.at(0, h, 0), turn, (w, h, 0.19 * stand.size), surface, outline=LATTICE)
    posts = [stand.foot + s * w * turn[0] for s in (-1, 1)]
    return [panel, *(rod(p, p - 2.06 * h * stand.axes[1], 0.02 * stand.size, surface) for p in posts)]


def lamp(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return a thin metal stand with a shade."""
    h = stand.size
    metal = Surface(paint.MOTTLED, ("#3c4046", "#6a6e74", "#202428"), 0.05 * h, 0.15)
    cloth = Surface(paint.WEAVE, (pick(rng, PALES), pick(rng, EARTHS), "#806040"), 0.03 * h, 0.25)
    return [
        primitive(CYLINDER, stand.at(0, 0.02 * h, 0), stand.axes, (0.2 * h, 0.02 * h, 1), metal),
        rod(stand.at(0, 0.02 * h, 0), stand.at(0, 0.72 * h, 0), 0.014 * h, metal),
        primitive(CYLINDER, stand.at(0, 0.8 * h, 0), stand.axes, (0.22 * h, 0.17 * h, 1), cloth, curve=(0.45, 0.0)),
    ]


def pendant(stand: Stand, rng: np.random.Generator) -> Rows:
    """Return beads on a string that hangs down to ``stand.foot``."""
    h = stand.size
    string = Surface(paint.STRIPE, ("#d8d0c0", "#5a4a3a", "#d8d0c0"), 0.05 * h, 0.1)
    rows = [rod(stand.at(0, 0, 0), stand.at(0, 3 * h, 0), 0.012 * h, string)]
    level = 0.0
    for share in (0.2, 0.3, 0.16):
        r = share * h / 2 * rng.uniform(0.85, 1.15)
        shape = (r, r * rng.uniform(0.8, 1.4), r)
        rows.append(primitive(ELLIPSOID, stand.at(0, level + r, 0), stand.turned(1.0), shape, _surface(rng, 2 * r)))
        level += 2.4 * r
    rows.append(
        primitive(
            PATCH,
            stand.at(0, -0.1 * h, 0),
            stand.turned(0.5),
            (0.1 * h, 0.1 * h, 1),
            _surface(rng, 0.2 * h),
            outline=DISC,
        )
    )
    return rows


Builder = Callable[[Stand, np.random.Generator], Rows]
LOW: tuple[Builder, ...] = (ball, blocks, mug, books)
MIDDLE: tuple[Builder, ...] = (globe, postcard, page)
TALL: tuple[Builder, ...] = (plant, vase, lamp, trellis)
