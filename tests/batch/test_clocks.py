"""The offset between two clocks: found where the times tell it, refused where they do not."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.batch.clocks import pair_by_time

OFFSET_TOLERANCE_S = 0.2


@pytest.mark.parametrize("offset_s", [0.0, -3600.0, 12.7])
def test_finds_the_offset_of_a_session(offset_s: float) -> None:
    """100 moments, of which either camera misses some, with 0.1 s of jitter."""
    generator = np.random.default_rng(4)
    moments = np.cumsum(generator.uniform(5, 60, 100))
    left = np.delete(moments, [3, 50])
    right = np.delete(moments, [7, 8, 90]) + offset_s + generator.uniform(-0.1, 0.1, 97)
    found = pair_by_time(left.tolist(), right.tolist(), 1.0)
    assert found.clock is not None
    assert found.clock.offset_s == pytest.approx(offset_s, abs=OFFSET_TOLERANCE_S)
    assert found.clock.agreeing == len(found.pairs) == 95
    assert all(abs(right[j] - offset_s - left[i]) < OFFSET_TOLERANCE_S for i, j in found.pairs)
    assert (len(found.lonely_left), len(found.lonely_right)) == (3, 2)


def test_equal_intervals_are_not_guessed() -> None:
    """A picture every 10 s: moved by one interval nearly as many fit."""
    left = [10.0 * n for n in range(12)]
    found = pair_by_time(left, [t + 3.0 for t in left], 1.0)
    assert found.pairs == ()
    assert found.clock is None
    assert "fit clocks +3.0 s apart (12 pairs)" in found.reason
    assert "--clock-offset-s" in found.reason
    given = pair_by_time(left, [t + 3.0 for t in left], 1.0, 3.0)
    assert given.pairs == tuple((n, n) for n in range(12))
    assert given.clock is not None
    assert given.clock.given


def test_a_single_pair() -> None:
    assert pair_by_time([5.0], [5.4], 1.0).pairs == ((0, 0),)
    far = pair_by_time([5.0], [500.0], 1.0)
    assert far.pairs == ()
    assert "one pair alone does not tell" in far.reason


def test_one_camera_alone() -> None:
    found = pair_by_time([1.0, 2.0], [], 1.0)
    assert found.lonely_left == (0, 1)
    assert found.reason == "there is no capture of the other camera"


def test_a_burst_is_ambiguous() -> None:
    left, right = [0.0, 30.0, 70.0, 70.5], [0.0, 30.0, 70.2]
    found = pair_by_time(left, right, 1.0)
    assert found.pairs == ((0, 0), (1, 1))
    assert found.ambiguous == (((2, 3), (2,)),)
