"""Command line of the benchmarks: `python -m benchmarks NAME [--case C] [--json] [--quick] [--keep] [--compare]`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")  # before numpy: one thread each, so that CPU times compare

if TYPE_CHECKING:
    from benchmarks.measurement import Measurement
    from benchmarks.store import Run


def main(arguments: list[str] | None = None) -> int:
    """Run one benchmark and print a row per measurement; return the exit status."""
    benches = all_benches()
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", choices=[*sorted(benches), "page"], help="'page' writes docs/benchmarks.md from --keep")
    parser.add_argument("--case", help="only cases whose name contains this")
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of a table")
    parser.add_argument("--quick", action="store_true", help="a subset that takes half a minute")
    parser.add_argument("--keep", action="store_true", help="keep the rows in out/bench/, by machine")
    parser.add_argument("--compare", action="store_true", help="say what got slower since the rows kept last")
    parser.add_argument("--plot", metavar="FILE", help="also draw seconds over the number of parts, as SVG")
    options = parser.parse_args(arguments)
    if options.name == "page":
        from benchmarks.page import write_page

        print(write_page())
        return 0
    from benchmarks.store import keep, path_of, read

    before = read(path_of(options.name, options.quick))
    rows: list[Measurement] = []
    whole = False
    try:
        for row in benches[options.name](options.quick, options.case):
            rows.append(row)
            print(row.json() if options.json else _line(row), flush=True)
        whole = options.case is None
    finally:
        if options.keep and rows:  # also what an interrupted run has
            keep(options.name, rows, options.quick, merge=not whole)
    if not rows:
        print(f"No case of '{options.name}' contains '{options.case}'.", file=sys.stderr)
        return 2
    if options.plot:
        from benchmarks.figure import time_figure

        Path(options.plot).write_text(time_figure(rows, f"{options.name}: seconds over parts"), encoding="utf-8")
    if options.compare:
        _compare(rows, before)
    return 0


def all_benches() -> dict[str, Callable[[bool, str | None], Iterator[Measurement]]]:
    """Return every benchmark by name."""
    from benchmarks import design_baseline, statics
    from benchmarks.agreement import agreement, agreement_configs
    from benchmarks.builds import builds
    from benchmarks.contacts import contacts
    from benchmarks.growth import growth
    from benchmarks.load_agreement import agreement_loads
    from benchmarks.physics import insertions, physics
    from benchmarks.plans import plans
    from benchmarks.profile import profile
    from benchmarks.samples import samples
    from benchmarks.states import states

    return {
        "agreement": agreement,
        "agreement_configs": agreement_configs,
        "agreement_loads": agreement_loads,
        "builds": builds,
        "statics": statics.statics,
        "tilt_sweep": statics.tilt_sweep,
        "friction": statics.friction,
        "contacts": contacts,
        "baseline": design_baseline.baseline,
        "configs": design_baseline.configs,
        "growth": growth,
        "insertions": insertions,
        "physics": physics,
        "plans": plans,
        "profile": profile,
        "samples": samples,
        "states": states,
    }


def _line(row: Measurement) -> str:
    return (
        f"{row.case:24} {row.tool:16} {row.seconds * 1e3:10.2f} ms ×{row.repeats}  kkt {row.kkt:8.1e}  "
        f"{row.memory_mb:6.0f} MB  {row.verdict}"
    )


def _compare(rows: list[Measurement], before: Run | None) -> None:
    from benchmarks.store import changes

    if before is None:
        print("  nothing was kept on this machine to compare with", file=sys.stderr)
        return
    found = changes(rows, before)
    for change in found:
        print(f"  {change.words()}", file=sys.stderr)
    if not found:
        print(f"  as on {before.about['date']}, within noise", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
