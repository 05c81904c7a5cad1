"""How a lattice is counted: rows, columns and the half shift."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.lenslet.lattice import Lattice, to_grid

ILLUM = (5368, 7728)


def hexagonal(pitch: float, origin: tuple[float, float], rotation: float = 0.0) -> Lattice:
    cos, sin = np.cos(rotation), np.sin(rotation)
    turn = np.array([[cos, -sin], [sin, cos]])
    return Lattice(np.array(origin), turn @ [pitch, 0], turn @ [pitch / 2, pitch * np.sqrt(3) / 2])


@pytest.mark.parametrize("pitch", [14.2857, 14.3125, 14.3439])
@pytest.mark.parametrize("origin", [(0.0, 0.0), (4.2, 11.0), (3871.1, 2600.7)])
def test_every_illum_has_one_size(pitch: float, origin: tuple[float, float]) -> None:
    grid = to_grid(hexagonal(pitch, origin, 9e-4), ILLUM, 20e-6 / 1.4e-6, 0.0, 1.0, "given")
    assert (grid.rows, grid.columns) == (434, 541)
    middle = grid.centres().reshape(-1, 2).mean(0)
    assert np.abs(middle - (3863.5, 2683.5)).max() < 7.2  # half a lenslet


@pytest.mark.parametrize("shift", [0.0, 3.0, 7.0, 11.0])
def test_grid_points_are_lattice_points(shift: float) -> None:
    lattice = hexagonal(14.3, (5.0 + shift, 9.0 + 2 * shift), 0.01)
    grid = to_grid(lattice, (400, 500), 14.3, 0.0, 1.0, "given")
    index = (grid.centres().reshape(-1, 2) - lattice.origin) @ lattice.reciprocal.T
    assert np.abs(index - np.round(index)).max() < 1e-9
    again = Lattice.of(grid)
    index = (again.origin - lattice.origin) @ lattice.reciprocal.T
    assert np.abs(index - np.round(index)).max() < 1e-9
    assert np.allclose(again.diagonal, lattice.diagonal)


def test_both_parities_occur() -> None:
    lattices = [hexagonal(14.3, (5.0, 9.0 + k)) for k in range(25)]
    found = {to_grid(lattice, (400, 500), 14.3, 0.0, 1.0, "given").first_shifted_row for lattice in lattices}
    assert found == {0, 1}


def test_points_inside_a_frame() -> None:
    lattice = hexagonal(10.0, (0.0, 0.0))
    index = lattice.indices_inside((100, 200), 5.0)
    points = lattice.origin + index @ lattice.matrix.T
    assert points.min() >= 5.0
    assert (points <= (194.0, 94.0)).all()
    # Area of a lenslet: 100 sqrt(3) / 2 = 86.6 px; 190 x 90 px hold about 197.
    assert len(index) == pytest.approx(197, abs=12)
