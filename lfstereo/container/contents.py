"""What the sections of a container are, told from the table of contents and from their first bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

from lfstereo.container.fields import LARGEST, Json
from lfstereo.container.format import Container, Section
from lfstereo.container.metadata import frame_entries
from lfstereo.errors import ContainerError

_NAMES = {
    "metadataRef": "JSON metadata",
    "privateMetadataRef": "JSON metadata, private (serial numbers)",
    "modulationDataRef": "white image of the camera",
    "hotPixelRef": "list of hot pixels",
}
_MAPS = {"depthMap": "depth map", "confidenceMap": "confidence map"}
_FLOAT_BYTES = 4
_LONGEST_KEY = 60
_JPEG_SIZE_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


@dataclass(frozen=True, slots=True)
class Reference:
    """One place in the table of contents that names a section."""

    path: str
    """Keys from the top, such as ``frames[0].frame.imageRef``."""
    name: str
    """``sha1-`` and 40 hexadecimal digits."""
    owner: Json
    """The object that holds the reference."""
    around: Json
    """The object that holds that one; empty at the top."""

    @property
    def key(self) -> str:
        """The last key of the path."""
        return self.path.rpartition(".")[2]

    @property
    def parent(self) -> str:
        """The key of the object that holds the reference, without a number in brackets."""
        return self.path.rpartition(".")[0].rpartition(".")[2].partition("[")[0]


def references(toc: Json) -> tuple[Reference, ...]:
    """Return all references of a table of contents in its own order."""
    return tuple(
        Reference(f"{path}.{key}" if path else key, name, owner, around)
        for path, owner, around in _objects(toc)
        for key, name in owner.items()
        if key.endswith("Ref") and isinstance(name, str) and name.lower().startswith("sha1-")
    )


def find_frame_section(container: Container, key: str) -> Section | None:
    """Return the section that the first frame refers to by a key such as ``imageRef``, or None without one."""
    name = _frame_name(container, key)
    return None if name is None else container.find(name)


def frame_section(container: Container, key: str) -> Section:
    """Return the section that the first frame refers to by a key such as ``imageRef``.

    Raises
    ------
    ContainerError
        If the file holds a processed picture without the frame, or is cut off before the section, or lists none.
    """
    section = find_frame_section(container, key)
    if section is not None:
        return section
    processed = processed_picture(container)
    if processed:
        raise ContainerError(f"{container.path}: found {processed}, no raw lenslet image; give the original LFR or LFP")
    name = _frame_name(container, key)
    if name is None:
        raise ContainerError(
            f"{container.path}: found a table of contents without a frame's {key}, expected one; this file holds no "
            "raw picture, give the original LFR or LFP"
        )
    raise ContainerError(
        f"{container.path}: byte {container.size}: the file ends here, expected the section {name[:45]!r} that the "
        f"table of contents names as the frame's {key}; the file is cut off or damaged, copy it again from the camera"
    )


def processed_picture(container: Container) -> str:
    """Return what a picture processed by Lytro's programs holds, in words.

    Empty if the file is none, or if it lacks a section that the programs computed (then it is cut off).
    """
    items = list(_accelerations(container.toc))
    computed = [r for r in references(container.toc) if "cceleration" in r.path]
    if not items or not all(container.find(r.name) for r in computed):
        return ""
    kinds = sorted({_word(str(item.get("kind", item.get("type", "unknown"))).rpartition(".")[2]) for item in items})
    known, objects = references(container.toc), _objects(container.toc)
    stack = [r for r in known if r.parent in ("perImage", "imageArray") and container.find(r.name)]
    outside = sum("imagePath" in owner and path.rpartition(".")[2].startswith("perImage") for path, owner, _ in objects)
    parts = [f"{len(stack)} JPEG focal-stack images"] if stack else []
    parts += [f"{outside} images in files beside it"] if outside else []
    for reference in known:
        if reference.parent in _MAPS and container.find(reference.name):
            parts.append(f"a {_map_text(reference, container)}")
    return f"a processed picture ({', '.join(kinds)}) with {', '.join(parts) if parts else 'no images'}"


def by_section(container: Container, known: Iterable[Reference]) -> dict[Section, Reference]:
    """Return the first reference to each section of a file."""
    found: dict[Section, Reference] = {}
    for reference in known:
        section = container.find(reference.name)
        if section is not None:
            found.setdefault(section, reference)
    return found


def section_text(container: Container, section: Section, data: bytes, reference: Reference | None) -> str:
    """Return in words what a section holds.

    Parameters
    ----------
    container
        The file it is part of.
    section
        The section.
    data
        Its data, damaged or not.
    reference
        The first one to it; ``None`` where the table of contents does not name it.
    """
    if section.kind == "toc":
        return "table of contents, JSON"
    if reference is None:
        return f"{_sniffed(data)}, not referred to"
    if reference.key == "imageRef" and reference.parent == "frame":
        return "raw lenslet image"
    if reference.parent in _MAPS:
        return _map_text(reference, container)
    if reference.key in _NAMES:
        return _NAMES[reference.key]
    if reference.key == "imageRef":
        role = "thumbnail" if reference.parent.startswith("thumbnail") else _word(reference.parent)
        focus = reference.owner.get("focus", reference.owner.get("lambda"))
        place = f"focused at lambda {focus:g}" if _is_number(focus) else role
        return f"{_sniffed(data)}, {place}"
    words = "".join(f" {c.lower()}" if c.isupper() else c for c in _word(reference.key.removesuffix("Ref")))
    return f"{words} ({_sniffed(data)})"


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) of a JPEG from its frame header, or None if there is none.

    References
    ----------
    ITU-T T.81 (1992), section B.2.2, frame header.
    """
    at = 2
    while data.startswith(b"\xff\xd8") and at + 9 <= len(data) and data[at] == 0xFF:
        if data[at + 1] in _JPEG_SIZE_MARKERS:
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None


def _frame_name(container: Container, key: str) -> str | None:
    entries = frame_entries(container.toc)
    frame = entries[0].get("frame") if entries else None
    name = frame.get(key) if isinstance(frame, dict) else None
    return name if isinstance(name, str) else None


def _word(text: str) -> str:
    """Return a name from the file such that it cannot break a line."""
    return "".join(c for c in text if c.isalnum())[:40]


def _sniffed(data: bytes) -> str:
    if size := jpeg_size(data):
        return f"JPEG {size[0]} x {size[1]}"
    if data.startswith(b"\x89PNG"):
        return "PNG"
    if data[:1] in (b"{", b"["):
        return "JSON"
    return "binary data"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and abs(value) <= LARGEST


def _map_text(reference: Reference, container: Container) -> str:
    width, height = (reference.owner.get(side, reference.around.get(side)) for side in ("width", "height"))
    if not (isinstance(width, int) and isinstance(height, int) and _is_number(width) and _is_number(height)):
        return f"{_MAPS[reference.parent]} of unknown size"
    section = container.find(reference.name)
    floats = section is not None and section.length == width * height * _FLOAT_BYTES
    return f"{_MAPS[reference.parent]} {width} x {height}" + (" float32" if floats else "")


def _accelerations(toc: Json) -> Iterator[Json]:
    """Yield what Lytro calls accelerations: the pictures and maps that its programs have computed."""
    for _, owner, _ in _objects(toc):
        for key in ("accelerations", "accelerationArray"):
            items = owner.get(key)
            yield from (item for item in (items if isinstance(items, list) else ()) if isinstance(item, dict))


def _objects(toc: Json) -> Iterator[tuple[str, Json, Json]]:
    """Yield every object inside a table of contents with its path and the object around it, in the table's order."""
    yield "", toc, {}
    waiting = [_inner("", toc, toc)]
    while waiting:
        found = next(waiting[-1], None)
        if found is None:
            waiting.pop()
            continue
        path, value, around = found
        if isinstance(value, dict):
            yield path, value, around
            around = value
        waiting.append(_inner(path, value, around))


_Place: TypeAlias = tuple[str, Json | list[Any], Json]


def _inner(path: str, value: Json | list[Any], around: Json) -> Iterator[_Place]:
    """Yield the objects and lists in one object or list; long keys are cut, so that paths stay short."""
    if isinstance(value, dict):
        named = ((f"{path}.{key[:_LONGEST_KEY]}" if path else key[:_LONGEST_KEY], item) for key, item in value.items())
    else:
        named = ((f"{path}[{n}]", item) for n, item in enumerate(value))
    return ((name, item, around) for name, item in named if isinstance(item, dict | list))
