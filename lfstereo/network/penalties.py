"""Weights of the energy that the binocular focus volume minimises."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Penalties:
    """Weights of the energy; chosen on rendered scenes that no evaluation uses."""

    match_ceiling: float = 12.0
    """Most that the match of the eyes adds."""
    unseen: float = 4.0
    """What it adds where the right picture does not reach."""
    census: float = 24.0
    """Factor of the census' product, -1 to 1, in the match; that of the learnt descriptors is their sharpness."""
    focus_weight: float = 1.0
    focus_ceiling: float = 4.0
    """Most that a slice's score lacks, before the weight."""
    small: float = 3.0
    """For a step of 1 px between neighbours."""
    large: float = 40.0
    """For any larger step, where the picture is even."""
    edge: float = 0.06
    """Difference of brightness (of 1.0) at which the larger penalty has fallen to half."""
