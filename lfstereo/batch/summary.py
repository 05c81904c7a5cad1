"""The summary of a batch: a CSV table and an HTML page, made from the record alone."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

from lfstereo.batch.figures import THUMBNAIL
from lfstereo.batch.pairing import Leftover
from lfstereo.batch.record import Entry
from lfstereo.outputs import atomic_file

CSV_NAME, HTML_NAME = "summary.csv", "summary.html"
_ALWAYS = ("valid_share", "view_difference", "disparity_low_px", "disparity_high_px", "depth_low_m", "depth_high_m")
_WITH_TRUTH = ("mae_px", "bad_1_percent", "bad_2_percent", "bad_4_percent", "median_depth_error")
_HEADS = {
    "valid_share": "valid",
    "view_difference": "view difference, levels",
    "disparity_low_px": "disparity from, px",
    "disparity_high_px": "to, px",
    "depth_low_m": "depth from, m",
    "depth_high_m": "to, m",
    "mae_px": "MAE, px",
    "bad_1_percent": "off by > 1 px, %",
    "bad_2_percent": "> 2 px, %",
    "bad_4_percent": "> 4 px, %",
    "median_depth_error": "median depth error",
}
_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; margin: 2em; color: #222 }
table { border-collapse: collapse } td, th { padding: .3em .8em; border-bottom: 1px solid #ddd; text-align: right }
th { position: sticky; top: 0; background: #fff } td.text, th.text { text-align: left }
tr.failed td { background: #fdecea } img { display: block; height: 90px }
"""


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
    for name, text in ((CSV_NAME, _csv(rows)), (HTML_NAME, _html(rows, leftovers))):
        with atomic_file(output / name, force=True) as scratch:
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


def _html(rows: Sequence[SummaryRow], leftovers: Sequence[Leftover]) -> str:
    names = _figure_names(rows)
    counts = {state: sum(row.state == state for row in rows) for state in ("done", "failed", "not done")}
    heads = ["seconds", "peak GiB", *(_HEADS[name] for name in names)]
    lines = [
        "<!doctype html><meta charset='utf-8'><title>lfstereo batch</title>",
        f"<style>{_STYLE}</style><h1>lfstereo batch</h1>",
        f"<p>{', '.join(f'{count} {state}' for state, count in counts.items())}</p>",
        "<table><tr><th class='text'>pair</th><th class='text'>all in focus, disparity</th>",
        "".join(f"<th>{escape(head)}</th>" for head in heads) + "<th class='text'>warnings</th></tr>",
        *(_html_row(row, names) for row in rows),
        "</table>",
    ]
    if leftovers:
        lines.append("<h2>Captures in no pair</h2><table>")
        for item in leftovers:
            places = ", ".join(capture.place.as_posix() for capture in item.captures)
            lines.append(
                f"<tr><td class='text'>{item.kind}</td><td class='text'>{escape(places)}</td>"
                f"<td class='text'>{escape(item.reason)}</td></tr>"
            )
        lines.append("</table>")
    return "\n".join(lines) + "\n"


def _html_row(row: SummaryRow, names: Sequence[str]) -> str:
    name = escape(row.name)
    found = row.entry.outcome if row.entry else None
    if found is None or row.state != "done":
        reason = escape(found.reason) if found and row.state == "failed" else row.state
        cells = f"<td class='text'>{name}</td><td class='text' colspan='{4 + len(names)}'>{reason}</td>"
        return f"<tr class='failed'>{cells}</tr>"
    link = quote(row.name)
    cells = f"<td class='text'><a href='{link}/report.html'>{name}</a></td>"
    cells += f"<td class='text'><img loading='lazy' alt='' src='{link}/{THUMBNAIL}'></td>"
    cells += f"<td>{sum(found.seconds.values()):.1f}</td><td>{found.peak_gib:.2f}</td>"
    cells += "".join(f"<td>{_shown(found.figures.get(figure))}</td>" for figure in names)
    cells += f"<td class='text'>{escape('; '.join(found.warnings))}</td>"
    return f"<tr>{cells}</tr>"


def _shown(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
