"""Which two captures belong together: by folder, by file name, or by serial number and capture time."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lfstereo.batch.captures import CaptureFile
from lfstereo.batch.clocks import ClockOffset, pair_by_time
from lfstereo.batch.options import BatchOptions, PairBy
from lfstereo.container.serials import camera_mark
from lfstereo.errors import ConfigError
from lfstereo.rig.geometry import Side
from lfstereo.rig.match import side_of
from lfstereo.rig.rig import StereoRig

USUAL_PATTERNS = ("{scene}_{side}", "{scene}-{side}", "{side}_{scene}", "{side}-{scene}", "{side}/{scene}", "{side}")
_SIDE_WORDS = {"left": "left", "l": "left", "right": "right", "r": "right"}


@dataclass(frozen=True, slots=True)
class PairFiles:
    """Two captures that belong together."""

    name: str
    """Of the result folder; unique in its batch."""
    left: CaptureFile
    right: CaptureFile


@dataclass(frozen=True, slots=True)
class Leftover:
    """Captures that are in no pair, and why."""

    kind: str
    """``"unpaired"``, ``"duplicate"``, ``"ambiguous"`` or ``"unreadable"``."""
    captures: tuple[CaptureFile, ...]
    reason: str


@dataclass(frozen=True, slots=True)
class Pairing:
    """What was made of a folder of captures."""

    way: PairBy
    pairs: tuple[PairFiles, ...]
    leftovers: tuple[Leftover, ...]
    clock: ClockOffset | None = None
    """Only where the pairs were told by time."""


def pair_captures(captures: Sequence[CaptureFile], rig: StereoRig, options: BatchOptions) -> Pairing:
    """Pair captures; whatever is not certain is left over with its reason.

    Parameters
    ----------
    captures
        From :func:`lfstereo.batch.captures.list_captures`.
    rig
        Its serial numbers tell left from right where the captures have any.
    options
        The way, the file name pattern, the clocks.

    Raises
    ------
    ConfigError
        If the pattern has no place for the side.
    """
    single, duplicates = _without_duplicates(captures)
    ways: dict[PairBy, Callable[[], Pairing]] = {
        "folder": lambda: _by_folder(single, rig),
        "name": lambda: _by_name(single, options.pattern),
        "time": lambda: _by_time(single, rig, options),
    }
    if options.pair_by != "auto":
        chosen = ways[options.pair_by]()
    elif options.pattern:
        chosen = ways["name"]()
    else:
        chosen = max((way() for way in ways.values()), key=lambda pairing: len(pairing.pairs))
    return replace(
        chosen,
        pairs=_uniquely_named(sorted(chosen.pairs, key=lambda pair: pair.name)),
        leftovers=(*chosen.leftovers, *duplicates),
    )


def _without_duplicates(captures: Sequence[CaptureFile]) -> tuple[list[CaptureFile], list[Leftover]]:
    """Keep the first of captures of one camera, time and raw frame; the others are the same bytes again."""
    seen: dict[tuple[str, str, str], CaptureFile] = {}
    single, duplicates = [], []
    for capture in captures:
        if capture.metadata is None or not capture.frame_sha1:
            single.append(capture)
            continue
        first = seen.setdefault((capture.serial, capture.metadata.captured_at, capture.frame_sha1), capture)
        if first is capture:
            single.append(capture)
        else:
            reason = f"the same exposure as {first.place}, which is used"
            duplicates.append(Leftover("duplicate", (capture,), reason))
    return single, duplicates


def _by_folder(captures: Sequence[CaptureFile], rig: StereoRig) -> Pairing:
    folders: dict[Path, list[CaptureFile]] = defaultdict(list)
    for capture in captures:
        folders[capture.place.parent].append(capture)
    pairs, leftovers = [], []
    for folder, inside in folders.items():
        if len(inside) == 1:
            leftovers.append(_alone(inside[0], "no other capture in its folder"))
        elif len(inside) > 2:
            reason = f"{len(inside)} captures in one folder, expected 2"
            leftovers.append(Leftover("ambiguous", tuple(inside), reason))
        else:
            sides = {_side(capture, rig): capture for capture in inside}
            if set(sides) == {"left", "right"}:
                name = folder.as_posix() if folder != Path() else "pair"
                pairs.append(PairFiles(name, sides["left"], sides["right"]))
            else:
                reason = "neither serial numbers nor file names tell which is left and which is right"
                leftovers.append(Leftover("ambiguous", tuple(inside), reason))
    return Pairing("folder", tuple(pairs), tuple(leftovers))


def _side(capture: CaptureFile, rig: StereoRig) -> Side | None:
    """Return the side by serial number; by file name where that tells nothing; ``None`` where they disagree."""
    by_serial = side_of(capture.serial, rig)
    words = re.split(r"[^a-z]+", capture.place.stem.lower())
    named = {_SIDE_WORDS[word] for word in words if word in _SIDE_WORDS}
    by_name = named.pop() if len(named) == 1 else None
    if by_serial and by_name and by_serial != by_name:
        return None
    found: Side | None = by_serial or by_name  # type: ignore[assignment]
    return found


def _by_name(captures: Sequence[CaptureFile], pattern: str) -> Pairing:
    patterns = [_compiled(p) for p in ((pattern,) if pattern else USUAL_PATTERNS)]
    scenes: dict[str, dict[str, list[CaptureFile]]] = defaultdict(lambda: defaultdict(list))
    leftovers: list[Leftover] = []
    for capture in captures:
        place = capture.place.with_suffix("").as_posix()
        match = next((m for p in patterns if (m := p.fullmatch(place))), None)
        if match is None:
            leftovers.append(_alone(capture, "its name does not fit the pattern"))
            continue
        parts = match.groupdict()
        scene = "/".join(part for part in (parts["folder"], parts.get("scene")) if part)
        scenes[scene or "pair"][_SIDE_WORDS[parts["side"].lower()]].append(capture)
    pairs = []
    for scene, sides in scenes.items():
        found = [*sides["left"], *sides["right"]]
        if len(sides["left"]) == len(sides["right"]) == 1:
            pairs.append(PairFiles(scene, *found))
        elif len(found) == 1:
            leftovers.append(_alone(found[0], "its other side is missing"))
        else:
            reason = f"{len(sides['left'])} left and {len(sides['right'])} right captures of scene '{scene}'"
            leftovers.append(Leftover("ambiguous", tuple(found), f"{reason}, expected one each"))
    return Pairing("name", tuple(pairs), tuple(leftovers))


def _compiled(pattern: str) -> re.Pattern[str]:
    """Return a pattern as regular expression; it is matched with the last parts of the path, without the suffix."""
    if pattern.count("{side}") != 1 or pattern.count("{scene}") > 1:
        raise ConfigError(
            f"pattern = {pattern!r}, expected {{side}} once and {{scene}} at most once, such as '{{scene}}_{{side}}'"
        )
    bare = re.sub(r"\.(lfr|lfp|raw|h5|hdf5)$", "", pattern, flags=re.IGNORECASE)
    text = re.escape(bare).replace(r"\{side\}", "(?P<side>left|right|l|r)").replace(r"\{scene\}", "(?P<scene>[^/]+)")
    return re.compile(rf"(?:(?P<folder>.+)/)?{text}", re.IGNORECASE)


def _by_time(captures: Sequence[CaptureFile], rig: StereoRig, options: BatchOptions) -> Pairing:
    leftovers, sides = [], {"left": list[CaptureFile](), "right": list[CaptureFile]()}
    for capture in captures:
        side = side_of(capture.serial, rig)
        if capture.problem:
            leftovers.append(Leftover("unreadable", (capture,), capture.problem))
        elif side is None:
            names = " and ".join(camera_mark(camera.serial) or "any" for camera in (rig.left, rig.right))
            leftovers.append(
                _alone(capture, f"taken by camera {camera_mark(capture.serial) or 'unknown'}, the rig's are {names}")
            )
        elif capture.taken_s is None:
            leftovers.append(_alone(capture, "its metadata tell no capture time"))
        else:
            sides[side].append(capture)
    matched = pair_by_time(
        [c.taken_s or 0.0 for c in sides["left"]],
        [c.taken_s or 0.0 for c in sides["right"]],
        options.clock_tolerance_s,
        options.clock_offset_s,
    )
    left, right = sides["left"], sides["right"]
    pairs = tuple(PairFiles(left[i].place.with_suffix("").as_posix(), left[i], right[j]) for i, j in matched.pairs)
    for lefts, rights in matched.ambiguous:
        together = tuple([left[i] for i in lefts] + [right[j] for j in rights])
        leftovers.append(Leftover("ambiguous", together, f"all within {options.clock_tolerance_s:g} s of each other"))
    for group, indices in ((left, matched.lonely_left), (right, matched.lonely_right)):
        leftovers += [_alone(group[i], matched.reason) for i in indices]
    return Pairing("time", pairs, tuple(leftovers), matched.clock)


def _alone(capture: CaptureFile, reason: str) -> Leftover:
    return Leftover("unreadable" if capture.problem else "unpaired", (capture,), capture.problem or reason)


def _uniquely_named(pairs: Sequence[PairFiles]) -> tuple[PairFiles, ...]:
    """Turn places into folder names; where two would be the same, each gets the suffix of its left capture."""
    flat = [pair.name.replace("/", "__").lstrip(".") or "pair" for pair in pairs]
    named = [
        replace(pair, name=name if flat.count(name) == 1 else f"{name}{pair.left.path.suffix}")
        for pair, name in zip(pairs, flat, strict=True)
    ]
    names = [pair.name for pair in named]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ConfigError(f"pairs: two of them would be called {twice}; rename one of their files or folders")
    return tuple(named)
