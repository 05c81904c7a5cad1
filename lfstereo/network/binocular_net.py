"""The binocular focus volume: both cues on one disparity axis, for any number of slices.

1. Every slice is scored for focus by the same weights; the scores weigh the slices into an all-in-focus image per eye.
2. The right image is brought to the exposure of the left one. How alike two pixels look, and how well their learnt
   descriptors agree, says at every disparity how well the eyes match.
3. What a disparity lacks in match and what it lacks in focus are added in one volume over (y, x, d), in which
   slice k stands at its own disparity, and aggregated along eight paths.
4. A U-Net with the sharp image at hand decides what to trust, fills what only one eye sees, corrects, and tells
   how large its error probably is.

Either cue may be missing: one stack alone is depth from focus, two sharp pictures alone are plain stereo.
The aggregation has no weights; the three trained parts learn one after the other, each from its own loss.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfstereo.arrays import Float32
from lfstereo.network.appearance import appearance_vectors
from lfstereo.network.census import census_vectors
from lfstereo.network.clues import clue_maps, confirmed, focus_disparity
from lfstereo.network.descriptor_net import DescriptorNet
from lfstereo.network.penalties import Penalties
from lfstereo.network.photometry import fitted_light
from lfstereo.network.refine_net import Refined, RefineNet
from lfstereo.network.semiglobal_torch import Matched, aggregate, focus_slack, read_out, volume_energy
from lfstereo.network.slice_scores import Focused, SliceScores
from lfstereo.network.volume import warp_right
from lfstereo.options import option

MULTIPLE = 32
"""Heights and widths that the network takes are multiples of this."""
SLICES = (5, 64)
"""Fewest and most slices of a stack."""
FARTHEST_SEARCH_PX = 256.0
"""Largest disparity that may be searched; memory grows with it."""
FOCUS_BINS = 97
"""Steps into which the range of one stack alone is divided."""
READINGS = 6
"""What is read out of the volume at every pixel."""
_BEYOND_PX = 4
"""Disparities searched beyond the nearest slice."""
_FEWEST_BINS = 16
_EXPOSURE_SHRINK = 4
"""Reduction at which the pictures are matched to compare their exposure."""


@dataclass(frozen=True, slots=True)
class BinocularArchitecture:
    """Widths of the three trained parts."""

    family: Literal["binocular"] = option("binocular", "which family of networks this is")
    slice_width: int = option(16, "channels per slice in the focus volume")
    descriptor_width: int = option(16, "channels of the descriptors' U-Net at full resolution")
    refine_width: int = option(16, "channels of the refinement's U-Net at full resolution")


@dataclass(frozen=True, slots=True)
class Seen:
    """What the two eyes tell before the cues meet."""

    focused: Focused
    """Left eye."""
    other: Tensor | None
    """``(1, 3, H, W)`` sharp image of the right eye in the left one's exposure, if there is one."""
    matched: Matched | None
    """What the eyes compare; ``None`` where there is one eye alone."""


@dataclass(frozen=True, slots=True)
class Front:
    """What stands before the refinement."""

    clues: Tensor
    """``(B, 16, H, W)``, see :func:`lfstereo.network.clues.clue_maps`."""
    offers: Tensor
    """``(B, 4, H, W)`` disparities in px to choose from."""
    sharp: Tensor
    """``(B, 3, H, W)`` all-in-focus image of the left eye, 0 to 1."""


class BinocularNet(nn.Module):
    """Two focal stacks, one stack, or two pictures, to the disparity of the left view."""

    def __init__(self, architecture: BinocularArchitecture = BinocularArchitecture()) -> None:
        super().__init__()
        self.architecture = architecture
        self.slices = SliceScores(architecture.slice_width)
        self.descriptors = DescriptorNet(architecture.descriptor_width)
        self.refine = RefineNet(architecture.refine_width)
        self.penalties = Penalties()

    def forward(
        self, left: Tensor, right: Tensor | None, foci: Tensor, use_focus: bool = True
    ) -> tuple[Refined, Front]:
        """Estimate the disparity of the left view.

        Parameters
        ----------
        left, right
            ``(1, K, 3, H, W)`` display-referred slices, 0 to 1, near to far; a sharp picture is a stack of one.
        foci
            ``(K,)`` px, falling; of a stack of one: the largest disparity to search.
        use_focus
            Whether the slices' scores count, beside making the sharp images.
        """
        front = self.front(left, right, foci, use_focus)
        return self.refine(front.clues, front.offers), front

    @torch.no_grad()
    def front(self, left: Tensor, right: Tensor | None, foci: Tensor, use_focus: bool = True) -> Front:
        """Score, match, aggregate; parameters as for :meth:`forward`."""
        return self.gather(self.look(left, right, foci), foci, use_focus)

    @torch.no_grad()
    def look(self, left: Tensor, right: Tensor | None, foci: Tensor) -> Seen:
        """Score the slices, make the sharp images alike in exposure and describe their pixels."""
        focused = self.slices(left)
        if right is None:
            return Seen(focused, None, None)
        other = self._in_left_light(focused.sharp, self.slices(right).sharp, foci)
        both = torch.cat((focused.sharp, other))
        learnt, sharpness = self.descriptors(both)
        looks = appearance_vectors(both, self.penalties.appearance)
        described = (self.penalties.learnt * sharpness[0] * learnt[0], learnt[1])
        return Seen(focused, other, Matched(described, (looks[0], looks[1])))

    def _in_left_light(self, sharp: Tensor, other: Tensor, foci: Tensor) -> Tensor:
        """Return the right picture in the exposure of the left one, as census matches of small pictures tell it."""
        small, small_other = (F.avg_pool2d(picture, _EXPOSURE_SHRINK) for picture in (sharp, other))
        census = census_vectors(torch.cat((small, small_other)))
        bins = max(_bins(foci) // _EXPOSURE_SHRINK + 1, _FEWEST_BINS)
        read = _readings(
            Matched((self.penalties.census * census[0], census[1])), None, foci, bins, small[0].mean(0), self.penalties
        )
        warped = warp_right(small_other, read[None, :1])
        gain, offset = fitted_light(small[0].flatten(1), warped[0].flatten(1), confirmed(read[4]).flatten())
        return (gain.view(1, 3, 1, 1) * other + offset.view(1, 3, 1, 1)).clamp(0, 1)

    @torch.no_grad()
    def gather(self, seen: Seen, foci: Tensor, use_focus: bool = True, use_match: bool = True) -> Front:
        """Put the cues that are wanted, and there, into one volume, aggregate it and read it out."""
        sharp = seen.focused.sharp
        other, matched = (seen.other, seen.matched) if use_match else (None, None)
        use_focus = (use_focus or matched is None) and seen.focused.scores.shape[1] > 1
        scores = seen.focused.scores[0] if use_focus else None
        readings = _readings(matched, scores, foci, _bins(foci), sharp[0].mean(0), self.penalties)[None]
        focus = focus_disparity(seen.focused.scores, foci) if use_focus else None
        clues, offers = clue_maps(sharp, readings, focus, other)
        return Front(clues, offers, sharp)


def _bins(foci: Tensor) -> int:
    """Return how many disparities, from 0 px, are searched for slices at these."""
    return max(int(float(foci.max())) + 1 + _BEYOND_PX, _FEWEST_BINS)


def _readings(
    matched: Matched | None, scores: Tensor | None, foci: Tensor, bins: int, guide: Tensor, weights: Penalties
) -> Tensor:
    """Aggregate the cues over disparities 0 to ``bins - 1`` and read out ``(6, H, W)``."""
    compiled = guide.device.type == "cpu" and find_spec("numba") is not None
    return (_compiled_readings if compiled else _torch_readings)(matched, scores, foci, bins, guide, weights)


def _torch_readings(
    matched: Matched | None, scores: Tensor | None, foci: Tensor, bins: int, guide: Tensor, weights: Penalties
) -> Tensor:
    energy = volume_energy(matched, scores, foci, bins, weights)
    return read_out(aggregate(energy, guide, weights), energy)


def _compiled_readings(
    matched: Matched | None, scores: Tensor | None, foci: Tensor, bins: int, guide: Tensor, weights: Penalties
) -> Tensor:
    from lfstereo.network import semiglobal

    height, width = guide.shape
    energy = np.zeros((height, width, bins), np.float32)
    sums = np.empty((2, *energy.shape), np.float32)
    if matched is not None:
        differing = sums[0, :0]
        if matched.looks is not None:
            differing = sums[0]
            semiglobal.differences(_pixels(matched.looks[0]), _mirrored(matched.looks[1]), differing)
        left, right = _pixels(matched.described[0]), _mirrored(matched.described[1])
        semiglobal.match_energy(left, right, differing, weights.match_ceiling, weights.unseen, energy)
    if scores is not None:
        places, slack = foci.numpy().astype(np.float32), focus_slack(matched, weights)
        semiglobal.add_focus_energy(_pixels(scores), places, weights.focus_weight, slack, weights.focus_ceiling, energy)
    level = np.ascontiguousarray(guide.numpy())
    semiglobal.aggregate(energy, level, weights.small, weights.large, weights.edge, sums)
    readings = np.empty((READINGS, height, width), np.float32)
    semiglobal.read_out(sums[0], energy, readings)
    return torch.from_numpy(readings)


def _pixels(maps: Tensor) -> Float32:
    """``(C, H, W)`` to a contiguous ``(H, W, C)``."""
    return np.ascontiguousarray(maps.permute(1, 2, 0).numpy())


def _mirrored(maps: Tensor) -> Float32:
    """``(C, H, W)`` to a contiguous ``(H, W, C)``, turned round in x."""
    return np.ascontiguousarray(_pixels(maps)[:, ::-1])
