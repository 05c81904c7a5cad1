"""A rig of the small sensor, shared by the simulator's tests."""

from __future__ import annotations

import pytest

from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig, build_rig


@pytest.fixture(scope="session")
def options() -> SimulateOptions:
    return SimulateOptions(sensor="small", samples=1, seed=3)


@pytest.fixture(scope="session")
def rig(options: SimulateOptions) -> SimulatedRig:
    return build_rig(options)
