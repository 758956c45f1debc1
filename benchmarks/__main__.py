"""Command line of the benchmarks: `python -m benchmarks NAME [--case C] [--json] [--quick] [--plot FILE]`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")  # before numpy: one thread each, so that CPU times compare


def main(arguments: list[str] | None = None) -> int:
    """Run one benchmark and print a row per measurement; return the exit status."""
    from benchmarks import design_baseline, statics
    from benchmarks.agreement import agreement
    from benchmarks.contacts import contacts
    from benchmarks.figure import time_figure

    benches = {
        "agreement": agreement,
        "statics": statics.statics,
        "tilt_sweep": statics.tilt_sweep,
        "friction": statics.friction,
        "contacts": contacts,
        "baseline": design_baseline.baseline,
        "configs": design_baseline.configs,
    }
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("name", choices=sorted(benches))
    parser.add_argument("--case", help="only cases whose name contains this")
    parser.add_argument("--json", action="store_true", help="one JSON object a line instead of a table")
    parser.add_argument("--quick", action="store_true", help="a subset that takes a minute")
    parser.add_argument("--plot", metavar="FILE", help="also draw seconds over the number of parts, as SVG")
    options = parser.parse_args(arguments)
    rows = []
    for row in benches[options.name](options.quick, options.case):
        rows.append(row)
        if options.json:
            print(row.json(), flush=True)
        else:
            print(
                f"{row.case:24} {row.tool:16} {row.seconds * 1e3:10.2f} ms ×{row.repeats}  kkt {row.kkt:8.1e}  "
                f"{row.memory_mb:6.0f} MB  {row.verdict}",
                flush=True,
            )
    if not rows:
        print(f"No case of '{options.name}' contains '{options.case}'.", file=sys.stderr)
        return 2
    if options.plot:
        Path(options.plot).write_text(time_figure(rows, f"{options.name}: seconds over parts"), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
