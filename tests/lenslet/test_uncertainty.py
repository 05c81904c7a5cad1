"""The uncertainty of a lattice against the scatter of many fits; smooth fields against known ones."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.lenslet.fit import robust_affine
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.smooth_field import fit_smooth_field
from lfstereo.lenslet.uncertainty import lattice_uncertainty

SHAPE = (600, 800)
NOISE_PX = 0.2


def test_uncertainty_is_the_scatter_of_many_fits() -> None:
    rng = np.random.default_rng(3)
    true = Lattice(np.array([5.0, 6.0]), np.array([14.3, 0.02]), np.array([7.1, 12.4]))
    index = true.indices_inside(SHAPE, 8)
    exact = true.origin + index @ true.matrix.T
    places = np.stack(np.meshgrid(np.linspace(0, 799, 5), np.linspace(0, 599, 5)), -1).reshape(-1, 2)
    where = (places - true.origin) @ true.reciprocal.T
    squares, told = [], []
    for _ in range(40):
        points = exact + rng.normal(0, NOISE_PX, exact.shape)
        weight = np.ones(len(points))
        fitted, _residual = robust_affine(index, points, weight)
        squares.append(((fitted.origin + where @ fitted.matrix.T - places) ** 2).sum(1).mean())
        told.append(lattice_uncertainty(fitted, index, points, weight, SHAPE))
    assert np.mean(told) == pytest.approx(np.sqrt(np.mean(squares)), rel=0.25)


def test_smooth_field_is_recovered() -> None:
    rng = np.random.default_rng(4)
    places = rng.uniform((0, 0), (799, 599), (4000, 2))
    x, y = (places / (799, 599) * 2 - 1).T
    true = np.stack([0.3 * x**2 - 0.1 * y, 0.2 * x * y + 0.05], axis=1)
    measured = true + rng.normal(0, 0.02, true.shape)
    measured[::9] += rng.normal(0, 3, measured[::9].shape)
    field, kept = fit_smooth_field(places, measured, np.ones(4000), 3, SHAPE)
    assert np.abs(field.at(places) - true).max() < 0.01
    assert 0.85 < kept.mean() < 0.92
    assert field.at(places[:6].reshape(2, 3, 2)).shape == (2, 3, 2)


@pytest.mark.parametrize("degree", [-1, 11])
def test_degree_that_cannot_be(degree: int) -> None:
    with pytest.raises(ConfigError, match="field_degree: found"):
        fit_smooth_field(np.zeros((3, 2)), np.zeros((3, 2)), np.ones(3), degree, SHAPE)
