"""A small light field that knows where it lies on a sensor."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.lightfield import LightField, ViewSampling


@pytest.fixture
def light_field() -> LightField:
    """3 x 5 views of 6 x 8 px, all values different, some above 1 and some without weight."""
    generator = np.random.default_rng(7)
    views = generator.uniform(0, 1, (3, 5, 6, 8, 3)).astype(np.float32)
    views[1, 2, 3, 4] = (1.5, 0.25, 0.0)
    weight = generator.integers(0, 256, (3, 5, 6, 8), dtype=np.uint8)
    sampling = ViewSampling((1.25, -2.5), (12.37, 12.38), -5.4e-4, 0.884)
    return LightField(views, weight, sampling, "B5143909630", "scene.h5")
