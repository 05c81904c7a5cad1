"""Pair the photographs of a target that the two cameras took."""

from __future__ import annotations

import re
from pathlib import Path

from lfstereo.errors import AssetError

SUFFIXES = (".lfr", ".lfp", ".raw", ".h5", ".hdf5")
_SIDE = re.compile(r"(?i)(?:^|[^a-z])(left|right)(?:[^a-z]|$)")


def pair_shots(left: Path, right: Path) -> list[tuple[str, Path, Path]]:
    """Return (name, left capture, right capture) of every shot.

    Files belong together that have the same name once "left" and "right" are taken out of it; where no name agrees,
    those at the same place in the order of names. Both folders may be the same if the names tell the sides.

    Raises
    ------
    AssetError
        If a folder is missing or holds no captures, or a capture has no partner, or would be its own.
    """
    found = [_captures(left, "left"), _captures(right, "right")]
    both = sorted(set(found[0]) & set(found[1]))
    if both:
        raise AssetError(
            f"{both[0]}: found in the left and in the right camera's photographs, expected each in one; put 'left' and "
            "'right' into the names, or give two folders"
        )
    named = [{_SIDE.sub("", path.stem): path for path in side} for side in found]
    if not named[0].keys() & named[1].keys() and len(found[0]) == len(found[1]):
        return [(a.stem, a, b) for a, b in zip(*found, strict=True)]
    lonely = sorted(named[0].keys() ^ named[1].keys())
    if lonely:
        side = int(lonely[0] not in named[0])
        other = (left, right)[1 - side]
        raise AssetError(
            f"{named[side][lonely[0]]}: found no partner in {other}, expected a capture of the same name; "
            "copy it there or move this one away"
        )
    return [(name, named[0][name], named[1][name]) for name in sorted(named[0])]


def pair_captures(paths: list[Path]) -> list[tuple[str, Path, Path]]:
    """Return (name, left capture, right capture) of captures given left and right in turn, or of two folders.

    Raises
    ------
    AssetError
        If a capture has no partner, or a file is missing.
    """
    if paths[0].is_dir() and paths[-1].is_dir() and len(paths) <= 2:
        return pair_shots(paths[0], paths[-1])
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise AssetError(f"{missing[0]}: found no such file, expected captures, left and right in turn, or two folders")
    if len(paths) % 2:
        raise AssetError(f"{paths[-1]}: found {len(paths)} captures, expected left and right in turn; give pairs")
    return [(left.stem, left, right) for left, right in zip(paths[::2], paths[1::2], strict=True)]


def _captures(folder: Path, side: str) -> list[Path]:
    if not folder.is_dir():
        raise AssetError(f"{folder}: found no such folder, expected the {side} camera's photographs of the target")
    captures = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    sides = {path: match.group(1).lower() for path in captures if (match := _SIDE.search(path.stem))}
    own = [path for path in captures if sides.get(path, side) == side]
    if not own:
        raise AssetError(
            f"{folder}: found no capture of the {side} camera, expected files ending in {', '.join(SUFFIXES)}"
        )
    return own
