"""What a result was made from: files by content, so that a finished pair is known again and a changed one is not."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lfstereo.lenslet.home import library_folder
from lfstereo.network.shipped import CARD, find_model
from lfstereo.options import read_toml
from lfstereo.pipeline import RunOptions
from lfstereo.results import sha256_of


@dataclass(frozen=True, slots=True)
class FileStamp:
    """A file's content, and what tells without reading that it was not touched."""

    path: str
    size: int
    modified_ns: int
    sha256: str


def stamp(path: Path, known: FileStamp | None = None) -> FileStamp:
    """Return the stamp of a file; its content is read only if size or time differ from a stamp known before."""
    status = path.stat()
    same = known is not None and (known.path, known.size, known.modified_ns) == (
        str(path),
        status.st_size,
        status.st_mtime_ns,
    )
    sha256 = known.sha256 if known is not None and same else sha256_of(path)
    return FileStamp(str(path), status.st_size, status.st_mtime_ns, sha256)


def fingerprint(inputs: Mapping[str, FileStamp], options: RunOptions, weights_sha256: str, whites: str) -> str:
    """Return the sha256 that two results share when they were made from the same files in the same way.

    Parameters
    ----------
    inputs
        Captures, rig and white images; their names and places do not count.
    options
        Where the network ran does not count.
    weights_sha256
        Of the network.
    whites
        From :func:`white_listing`; counts where a white image was used.
    """
    used_whites = any(role.startswith("white") for role in inputs)
    content: dict[str, Any] = {
        "inputs": {role: found.sha256 for role, found in sorted(inputs.items())},
        "options": counted_options(options),
        "weights": weights_sha256,
        "whites": whites if used_whites else "",
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def counted_options(options: RunOptions) -> dict[str, Any]:
    """Return the options that change a result."""
    return {name: value for name, value in asdict(options).items() if name != "device"}


def white_listing(whites: Path | None) -> str:
    """Return a sha256 of the names and sizes of the white images, so that a new one, maybe a nearer one, is noticed.

    Without a folder it is of those imported before.
    """
    whites = whites or library_folder()
    if not whites.exists():
        return ""
    files = [whites] if whites.is_file() else sorted(p for p in whites.rglob("*") if p.is_file())
    lines = [f"{path.relative_to(whites).as_posix()} {path.stat().st_size}" for path in files]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def result_sha256(folder: Path) -> str:
    """Return the sha256 of a result folder's ``run.toml``: its times to the millisecond tell it from every other."""
    return sha256_of(folder / "run.toml")


def model_sha256(model: str) -> str:
    """Return the sha256 of a model's weights as its card states it; a worker verifies it when it loads them.

    Raises
    ------
    AssetError
        If there is no such model.
    ConfigError
        If its card is damaged.
    """
    return str(read_toml(find_model(model) / CARD).get("sha256", ""))
