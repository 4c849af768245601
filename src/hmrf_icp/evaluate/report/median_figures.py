"""Medians by decile of overlap, the paper's released rows beside ours."""

from __future__ import annotations

from hmrf_icp.evaluate.report.comparison import decile_medians
from hmrf_icp.evaluate.report.methods import LABELS
from hmrf_icp.evaluate.report.published import PAPER_ORDER, PaperRows
from hmrf_icp.evaluate.report.runs import ReportedStart, angle_label
from hmrf_icp.evaluate.report.study import Study
from hmrf_icp.evaluate.report.style import BLUE, GREY, Drawing, drawing_style, sheet, shown

KINDS = (("error_m", "Translation (m)"), ("error_rad", "Rotation (rad)"))


def medians_figure(
    study: Study, paper: PaperRows, start: ReportedStart | None, angle: float
) -> Drawing:
    """Draw a column of panels a method: medians of the paper dashed, ours solid."""
    methods = [method for method in PAPER_ORDER if method in paper.methods]
    chosen = paper.started_at(angle)
    ours = None if start is None else study.runs.where(study.runs.begun_at(start))
    with drawing_style():
        figure, grid = sheet(2, len(methods), 2.0, 2.2)
        for (column, title), row in zip(KINDS, grid, strict=True):
            published = paper.metres if column == "error_m" else paper.radians
            highest = 0.0
            for axes, method in zip(row, methods, strict=True):
                x, y = decile_medians(paper.overlap[chosen], published[method][chosen])
                axes.plot(
                    x,
                    y,
                    color=GREY,
                    linestyle="--",
                    marker="o",
                    label=shown(f"{paper.name} (paper)"),
                )
                highest = max(highest, float(y.max(initial=0.0)))
                if ours is not None:
                    mask = ours.of(method)
                    x, y = decile_medians(ours["overlap"][mask], ours[column][mask])
                    axes.plot(x, y, color=BLUE, marker="s", label=shown(study.dataset))
                    highest = max(highest, float(y.max(initial=0.0)))
            for axes, method in zip(row, methods, strict=True):
                axes.set_ylim(0.0, 1.08 * highest or 1.0)
                axes.set_xlim(0.0, 1.0)
                axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
                axes.set_title(LABELS[method])
                if axes is row[0]:
                    axes.set_ylabel(title)
                else:
                    axes.tick_params(labelleft=False)
        for axes in grid[1]:
            axes.set_xlabel("Overlap")
        handles, labels = grid[0][-1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=2)
        turned = "" if paper.angle is None else f" (starts turned by {angle_label(angle)})"
        here = "" if start is None else f", and of {study.dataset} started {start.label} off, solid"
        return Drawing.of(
            figure,
            f"paper-{paper.name}" + ("" if start is None else f"-{start.slug}"),
            f"Median errors by decile of overlap: the released rows of {paper.name}{turned}, "
            f"dashed{here}.",
            "Twelve small line plots, the six methods of the paper by two kinds of error, against "
            "overlap; the values are in the tables of medians by overlap.",
        )
