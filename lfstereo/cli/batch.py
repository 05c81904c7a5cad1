"""``lfstereo batch``: every stereo pair under a folder to depth."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lfstereo.batch.options import BatchOptions
from lfstereo.batch.plan import BatchRequest, Plan, plan_batch
from lfstereo.options import add_arguments, from_arguments, read_toml
from lfstereo.pipeline import RunOptions


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("captures", type=Path, help="folder with the captures of both cameras, in any sub-folders")
    parser.add_argument("--rig", type=Path, required=True, help="rig file of the two cameras")
    parser.add_argument("--whites", type=Path, help="folder with the cameras' white images; needed for raw captures")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder for the results; started again, it is continued"
    )
    parser.add_argument("--dry-run", action="store_true", help="show the pairs and what is to be done, and do nothing")
    parser.add_argument(
        "--config", type=Path, help="TOML file with options in [run] and [batch]; the command line goes before it"
    )
    parser.add_argument("--json", action="store_true", help="print plan or summary as JSON on stdout")
    add_arguments(parser, BatchOptions)
    add_arguments(parser, RunOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    tables = read_toml(arguments.config) if arguments.config else {}
    request = BatchRequest(
        captures=arguments.captures.resolve(),
        rig=arguments.rig.resolve(),
        whites=arguments.whites.resolve() if arguments.whites else None,
        output=arguments.output.resolve(),
        run=from_arguments(RunOptions, arguments, tables.get("run", {}), f"{arguments.config} [run]"),
        batch=from_arguments(BatchOptions, arguments, tables.get("batch", {}), f"{arguments.config} [batch]"),
    )
    if arguments.dry_run:
        plan = plan_batch(request)
        print(json.dumps(_plan_values(plan), indent=2) if arguments.json else "\n".join(_plan_lines(plan)))
        return 0
    from lfstereo.batch.conversion import run_batch

    report = run_batch(request, announce=None if arguments.json else _announce)
    if arguments.json:
        print(json.dumps(asdict(report), indent=2))
        return report.exit_code
    print(f"{report.done} converted, {report.kept} kept, {len(report.failed)} failed, {len(report.not_done)} not done")
    for name, reason in report.failed.items():
        print(f"  {name}: {reason}")
    if report.unreadable:
        print(f"  {report.unreadable} captures cannot be read and are in no pair; --dry-run lists them")
    if report.stopped:
        print(f"  stopped: {report.stopped}; start again to go on")
    print(f"results: {arguments.output}/ (look first at {arguments.output / 'summary.html'})")
    return report.exit_code


def _announce(plan: Plan) -> None:
    pairs = {f"  {pair.files.name}:" for pair in plan.pairs if pair.finished or pair.why == "new"}
    lines = [line for line in _plan_lines(plan) if not any(line.startswith(start) for start in pairs)]
    print("\n".join(lines), file=sys.stderr, flush=True)


def _plan_lines(plan: Plan) -> list[str]:
    pairing = plan.pairing
    lines = [f"{len(pairing.pairs)} pairs by {pairing.way}; of {len(plan.pairs)} here {len(plan.to_do)} to do"]
    if pairing.clock is not None:
        clock = pairing.clock
        how = (
            "given"
            if clock.given
            else f"estimated from {clock.agreeing} pairs, the farthest {clock.spread_s:.2f} s off"
        )
        lines.append(f"right clock {clock.offset_s:+.2f} s against the left one ({how})")
    for pair in plan.pairs:
        files = pair.files
        state = "finished" if pair.finished else f"to do ({pair.why})"
        lines.append(f"  {files.name}: {files.left.place} + {files.right.place}: {state}")
    for item in pairing.leftovers:
        places = ", ".join(str(capture.place) for capture in item.captures)
        lines.append(f"  {item.kind}: {places}: {item.reason}")
    if plan.record.torn_lines:
        lines.append(f"{plan.record.torn_lines} lines of the record were cut off; their pairs are done again")
    return lines


def _plan_values(plan: Plan) -> dict[str, Any]:
    pairing = plan.pairing
    return {
        "way": pairing.way,
        "clock": asdict(pairing.clock) if pairing.clock else None,
        "pairs": [
            {
                "name": pair.files.name,
                "left": str(pair.files.left.place),
                "right": str(pair.files.right.place),
                "finished": pair.finished,
                "why": pair.why,
            }
            for pair in plan.pairs
        ],
        "leftovers": [
            {"kind": item.kind, "captures": [str(c.place) for c in item.captures], "reason": item.reason}
            for item in pairing.leftovers
        ],
    }
