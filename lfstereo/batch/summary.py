"""The summary of a batch: a CSV table and an HTML page, made from the record alone."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lfstereo import __version__
from lfstereo.batch.figures import THUMBNAIL
from lfstereo.batch.pairing import Leftover
from lfstereo.batch.record import Entry
from lfstereo.outputs import atomic_file
from lfstereo.viewer.content import PAGE_NAME
from lfstereo.viewer.template import fill_page

CSV_NAME, HTML_NAME = "summary.csv", "summary.html"
_ALWAYS = ("valid_share", "view_difference", "disparity_low_px", "disparity_high_px", "depth_low_m", "depth_high_m")
_WITH_TRUTH = ("mae_px", "bad_1_percent", "bad_2_percent", "bad_4_percent", "median_depth_error")
_SHOWN = {
    "valid_share": ("valid, %", 100.0, 1),
    "view_difference": ("view difference, levels", 1.0, 2),
    "disparity_low_px": ("disparity from, px", 1.0, 1),
    "disparity_high_px": ("disparity to, px", 1.0, 1),
    "depth_low_m": ("nearest, m", 1.0, 3),
    "depth_high_m": ("farthest, m", 1.0, 3),
    "mae_px": ("mean error, px", 1.0, 2),
    "bad_1_percent": ("off by > 1 px, %", 1.0, 1),
    "bad_2_percent": ("> 2 px, %", 1.0, 1),
    "bad_4_percent": ("> 4 px, %", 1.0, 1),
    "median_depth_error": ("median depth error, %", 100.0, 2),
}
"""Figure -> head of its column on the page, factor and digits behind the point."""


@dataclass(frozen=True, slots=True)
class SummaryRow:
    """One pair of the batch."""

    name: str
    state: str
    """``"done"``, ``"failed"`` or ``"not done"``."""
    entry: Entry | None


def write_summary(output: Path, rows: Sequence[SummaryRow], leftovers: Sequence[Leftover]) -> None:
    """Write ``summary.csv`` and ``summary.html``; each appears whole.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    _write(output / CSV_NAME, _csv(rows))
    _write(output / HTML_NAME, fill_page(page_content(output, rows, leftovers), "batch"))


def _write(path: Path, text: str) -> None:
    with atomic_file(path, force=True) as scratch:
        scratch.write_text(text, "utf-8")


def _figure_names(rows: Sequence[SummaryRow]) -> tuple[str, ...]:
    present = {name for row in rows if row.entry for name in row.entry.outcome.figures}
    return (*_ALWAYS, *(name for name in _WITH_TRUTH if name in present))


def _csv(rows: Sequence[SummaryRow]) -> str:
    names = _figure_names(rows)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["pair", "state", "reason", "attempt", "seconds", "peak_gib", "points", *names, "warnings"])
    for row in rows:
        found = row.entry.outcome if row.entry else None
        if found is None or row.state == "not done":
            writer.writerow([row.name, row.state, *[""] * (6 + len(names))])
            continue
        figures = [found.figures.get(name, "") for name in ("points", *names)]
        seconds = round(sum(found.seconds.values()), 2)
        writer.writerow(
            [
                row.name,
                row.state,
                found.reason,
                found.attempt,
                seconds,
                found.peak_gib,
                *figures,
                "; ".join(found.warnings),
            ]
        )
    return text.getvalue()


def page_content(output: Path, rows: Sequence[SummaryRow], leftovers: Sequence[Leftover]) -> dict[str, Any]:
    """Return what the page shows, once the table lies beside it.

    Keys
    ----
    ``title``, ``lede``, ``made`` as on every page; ``columns`` of figures with their heads; ``pairs`` in order, with
    ``state``, where their page and small picture lie, figures and warnings; ``left_out``; ``files`` beside the page.
    """
    names = _figure_names(rows)
    counts = {state: sum(row.state == state for row in rows) for state in ("done", "failed", "not done")}
    size = (output / CSV_NAME).stat().st_size
    return {
        "title": [output.resolve().name],
        "lede": ", ".join(f"{count} {state}" for state, count in counts.items()) + ".",
        "made": f"lfstereo {__version__}",
        "columns": [
            dict(zip(("name", "head", "factor", "digits"), (name, *_SHOWN[name]), strict=True)) for name in names
        ],
        "pairs": [_page_row(row, names) for row in rows],
        "left_out": [
            [item.kind, ", ".join(capture.place.as_posix() for capture in item.captures), item.reason]
            for item in leftovers
        ],
        "files": [{"name": CSV_NAME, "href": CSV_NAME, "about": "the same as a table", "bytes": size}],
    }


def _page_row(row: SummaryRow, names: Sequence[str]) -> dict[str, Any]:
    found = row.entry.outcome if row.entry else None
    if found is None or row.state == "not done":
        return {"name": row.name, "state": row.state}
    if row.state == "failed":
        return {"name": row.name, "state": row.state, "reason": found.reason}
    folder = quote(row.name)
    return {
        "name": row.name,
        "state": row.state,
        "page": f"{folder}/{PAGE_NAME}",
        "picture": f"{folder}/{THUMBNAIL}",
        "seconds": sum(found.seconds.values()),
        "peak_gib": found.peak_gib,
        "figures": [found.figures.get(name) for name in names],
        "warnings": list(found.warnings),
    }
