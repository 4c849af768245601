"""How often what is told 0.9 is right, by what is known of the views: ``reliability.py CSV ...``.

    python benchmarks/nowhere.py ../shared/data --methods robust --output nowhere.csv
    python benchmarks/reliability.py nowhere.csv

Reads what ``nowhere.py`` wrote and draws one panel a kind: clouds that came with their camera or
viewpoint; points alone of one view, which is recovered from them; and fused clouds, which have
none. In each the share of right ones in ten bins of the confidence told, with Wilson's intervals,
and below it how many were told what. Prints the figures as a table.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

from hmrf_icp.drawing import palette
from hmrf_icp.evaluate.report.statistics import area_under_roc, reliability
from hmrf_icp.figures.style import inked, own_figure
from hmrf_icp.io.whole import written_whole

FIGURE = Path(__file__).parents[1] / "docs" / "figures" / "reliability.png"
FUSED = ("3dmatch", "3dlomatch", "fragments-exact")
METHOD, TOLD, BINS = "robust", 0.5, 10
KINDS = ("views known", "views recovered", "no views")


def kind_of(row: dict[str, str]) -> str:
    """Say what was known of where both clouds were seen from."""
    if row["judge"] in FUSED:
        return "no views"
    return "views known" if row["given"] == "known" else "views recovered"


def read(paths: list[Path]) -> dict[str, list[dict[str, str]]]:
    """Rows of the default by kind; pairs of mixed sensors (``real-...``) are of no one kind."""
    found: dict[str, list[dict[str, str]]] = {kind: [] for kind in KINDS}
    for path in paths:
        for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
            if row["method"] == METHOD and row["confidence"] and "real-" not in row["judge"]:
                found[kind_of(row)].append(row)
    return {kind: rows for kind, rows in found.items() if rows}


def told(rows: list[dict[str, str]]) -> tuple[np.ndarray, np.ndarray]:
    """Confidence (K,) and whether each was right (K,)."""
    return (
        np.array([float(row["confidence"]) for row in rows]),
        np.array([row["right"] == "1" for row in rows]),
    )


def line(name: str, rows: list[dict[str, str]]) -> str:
    """One line of the table."""
    confidence, right = told(rows)
    sure = confidence >= TOLD
    area = area_under_roc(confidence, right)
    cells = (
        f"{len(rows)}",
        f"{right.mean():.3f}",
        f"{(sure & right).sum()}, {(sure & ~right).sum()}",
        f"{sure[right].mean():.2f}" if right.any() else "",
        "" if area is None else f"{area:.3f}",
        f"{reliability(confidence, right, BINS).calibration_error:.3f}",
    )
    return f"| {name} | " + " | ".join(cells) + " |"


def table(kinds: dict[str, list[dict[str, str]]]) -> str:
    """Lay out kinds, and the judges of each."""
    lines = [
        "| results | runs | right | told 0.5 or more: right, wrong | of the right ones "
        "| area under ROC | calibration error |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for kind, rows in kinds.items():
        lines.append(line(f"**{kind}**", rows))
        for judge in dict.fromkeys(row["judge"] for row in rows):
            lines.append(line(judge, [row for row in rows if row["judge"] == judge]))
    lines.append(line("**all**", [row for rows in kinds.values() for row in rows]))
    return "\n".join(lines)


def draw(kinds: dict[str, list[dict[str, str]]], path: Path) -> None:
    """Draw a panel a kind."""
    figure = own_figure(3.1 * len(kinds) + 0.5, 4.2)
    width = 0.95 / len(kinds)
    for number, (kind, rows) in enumerate(kinds.items()):
        left = 0.06 + number * width
        top = figure.add_axes((left, 0.36, width - 0.04, 0.55))
        below = figure.add_axes((left, 0.12, width - 0.04, 0.19), sharex=top)
        ink = inked(top)
        inked(below)
        confidence, right = told(rows)
        found = reliability(confidence, right, BINS)
        height = [share.solved / share.runs for share in found.shares]
        low, high = np.array([share.interval for share in found.shares]).T
        top.plot([0, 1], [0, 1], color=ink, linewidth=0.8, linestyle="--")
        top.vlines(found.confidence, low, high, color=palette.SOURCE, linewidth=1.0, alpha=0.7)
        top.plot(found.confidence, height, "o", color=palette.SOURCE, markersize=5)
        top.set_title(f"{kind}: {len(rows)} runs", color=ink, fontsize=10)
        top.tick_params(labelbottom=False)
        edges = np.linspace(0.0, 1.0, BINS + 1).tolist()
        below.hist(
            [confidence[right], confidence[~right]],
            bins=edges,
            color=[palette.INLIER, palette.VIOLATED],
            label=["right", "wrong"],
        )
        below.set_yscale("symlog", linthresh=1)
        below.yaxis.set_major_formatter(lambda y, _: f"{y:g}")
        below.set_xlabel("confidence told")
        top.set(xlim=(-0.02, 1.02), ylim=(-0.03, 1.03))
        if number == 0:
            top.set_ylabel("share that was right")
            below.set_ylabel("runs")
            below.legend(frameon=False, labelcolor=ink, loc="upper left", fontsize=8)
    with written_whole(path) as partial:
        figure.savefig(partial)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("csv", type=Path, nargs="+", help="what nowhere.py wrote")
    parser.add_argument("--figure", type=Path, default=FIGURE)
    chosen = parser.parse_args()
    kinds = read(chosen.csv)
    print(table(kinds))
    draw(kinds, chosen.figure)


if __name__ == "__main__":
    main()
