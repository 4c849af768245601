"""Every speed that is promised, beside its peer: one command, one table.

    python benchmarks/speed.py --json speed.json --figure speed.png
    python benchmarks/speed.py --rows depth,lidar --quick

Each row is a median over pairs. Ours and the peer take turns in the same process, so that a busy
minute slows both, and the ratio is the median of the ratios within a pair. Both may use as many
threads as ``--threads`` says and begin with points in memory: trees, normals and covariances are
in their times. Everything is warm but for the rows that say otherwise. Reads ``../shared/data``
(``--data``) and renders what it can where that is missing. ``pip install '.[peers]'`` brings the
peers; rows without theirs, or without data, are left out with a sentence.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from dataclasses import asdict
from pathlib import Path

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def names(text: str) -> list[str]:
    """Split at commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def options() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=names, help="which, by name; default: all")
    parser.add_argument("--list", action="store_true", help="print their names and stop")
    parser.add_argument("--quick", action="store_true", help="few pairs, few repeats")
    parser.add_argument("--threads", type=int, default=2, help="each may use; default 2")
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--json", type=Path, help="write all that was measured")
    parser.add_argument("--beside", type=Path, help="JSON with the rows that are not run now")
    parser.add_argument("--figure", type=Path, help="draw stages, size and recall (PNG)")
    return parser.parse_args()


def limit(threads: int) -> None:
    """Let nobody use more threads; to be called before any library counts the cores."""
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, cores[:threads])
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = str(threads)


def line(name: str, row: dict) -> str:
    """Lay out one row of the table."""
    unit = row["unit"]
    value = f"{row['value']:.2f}" if row["value"] < 10 else f"{row['value']:.0f}"
    held = "" if row["bound"] is None else ("yes" if row["value"] <= row["bound"] else "**no**")
    bound = "" if row["bound"] is None else f"{row['bound']:g} {unit}".strip()
    times = [f"{row[key]:.3g} s" if row[key] is not None else "" for key in ("ours", "theirs")]
    count = f"{row['count']}" + (f", {row['note']}" if row["note"] else "")
    cells = [row["work"], row["peer"], *times, f"{value} {unit}".strip(), bound, held, count]
    return "| " + " | ".join([name, *cells]) + " |"


HEAD = (
    "| row | work | peer | ours | peer's | ratio or value | at most | held | measured |\n"
    "|---|---|---|---:|---:|---:|---:|---|---|"
)


def main() -> None:
    """Measure, print, write and draw."""
    asked = options()
    limit(asked.threads)
    import speed_alone  # loads libraries that count the cores
    import speed_rows
    import speed_size
    from depth_pairs import machine
    from speed_measure import Left, Setting

    warnings.simplefilter("ignore")
    rows = speed_rows.ROWS | speed_size.ROWS | speed_alone.ROWS
    if asked.list:
        print(*(f"{name:<10} {row.work}" for name, row in rows.items()), sep="\n")
        return
    wanted = list(rows) if asked.rows is None else asked.rows
    if unknown := set(wanted) - set(rows):
        sys.exit(f"no row is called {', '.join(sorted(unknown))}; known: {', '.join(rows)}")
    setting = Setting(asked.data, asked.threads, asked.quick)
    measured: dict[str, dict] = {}
    before = {}
    if asked.beside:
        before = json.loads(asked.beside.read_text(encoding="utf-8"))["rows"]
    about = f"{machine()}; {asked.threads} threads each"
    print(f"{about}\n\n{HEAD}", flush=True)
    for name in wanted:
        row = rows[name]
        try:
            found = row.run(setting)
        except Left as left:
            print(f"left out: {name}: {left}", file=sys.stderr, flush=True)
            continue
        measured[name] = {
            "work": row.work,
            "peer": row.peer,
            "bound": row.bound,
            "unit": row.unit,
        } | asdict(found)
        print(line(name, measured[name]), flush=True)
        if asked.json:  # after each, so that what was measured is not lost
            content = {"machine": about, "quick": asked.quick, "rows": before | measured}
            asked.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    if asked.figure:
        import speed_figure

        speed_figure.draw(before | measured, asked.figure)


if __name__ == "__main__":
    main()
