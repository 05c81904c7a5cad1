"""Weights of the energy that the binocular focus volume minimises."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Penalties:
    """Weights of the energy; chosen on rendered scenes that no evaluation uses."""

    appearance: float = 16.0
    """For a difference of 1 in one colour or one of its slopes, the mean of 3 x 3 px."""
    learnt: float = 0.3
    """Factor of the product of the learnt descriptors."""
    census: float = 24.0
    """Factor of the census' product where small pictures are matched to compare their exposure."""
    match_ceiling: float = 12.0
    """Most that the match of the eyes adds."""
    unseen: float = 4.0
    """What it adds where the right picture does not reach."""
    focus_weight: float = 1.0
    focus_ceiling: float = 4.0
    """Most that a slice's score lacks, before the weight."""
    focus_slack: float = 2.0
    """What a score may lack for nothing where the eyes match: slices lie several px apart, matches less than one."""
    small: float = 3.0
    """For a step of 1 px between neighbours."""
    large: float = 24.0
    """For any larger step, where the picture is even."""
    edge: float = 0.05
    """Difference of brightness (of 1.0) at which the larger penalty has fallen to half."""
