"""A picture of one registration: the clouds before and after, the distances, the inlier field."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hmrf_icp import presets, se3
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.drawing import palette
from hmrf_icp.errors import InputError
from hmrf_icp.figures.before_after import before_after
from hmrf_icp.figures.convergence import convergence
from hmrf_icp.figures.labels import colour_bar, field, image_of, label_scale, labels
from hmrf_icp.figures.residuals import residuals
from hmrf_icp.figures.style import DPI, Names, own_figure
from hmrf_icp.loop.placed import Placed
from hmrf_icp.result import RegistrationResult, count
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    from hmrf_icp.presets import Registrar

SIZE = 11.0, 8.0
"""Inches."""


@dataclass(frozen=True, eq=False)
class InlierField:
    """What EM made of the initial configuration, before the first motion (paper, ex_frame).

    Attributes
    ----------
    distance
        (H, W) or (N,) Y, of each source point to the closest target point, metres.
    first, last
        Expected labels in [-1, 1] after the first EM step, and after
        the last before the first motion.
    steps
        The number of EM steps that led to ``last``.

    All are NaN where the source is unobserved.
    """

    distance: Array
    first: Array
    last: Array
    steps: int


def field_before_first_step(
    source: PointCloud,
    target: PointCloud,
    init: ArrayLike | None = None,
    preset: str | Registrar = presets.DEFAULT,
) -> InlierField:
    """Match and reject in the initial configuration, without moving anything.

    A method that tries more than one start is asked about this one alone.

    Parameters
    ----------
    source, target
        The cloud that moves and the one that stays.
    init
        (4, 4) start, source to target; None for the identity.
    preset
        The method that is used, as for ``register``; it has the parts ``match``
        and ``reject``. A rejection without EM steps decides once: its first
        decision is its last.

    Raises
    ------
    InputError
        The start is not a rigid motion, the preset is unknown, or it cannot do
        with this source.
    """
    prepared = PreparedCloud(source), PreparedCloud(target)
    method: Any = presets.preset(preset) if isinstance(preset, str) else preset
    method = getattr(method, "method", method)  # the loop within, where there is more round it
    placed = Placed.at(se3.as_rigid(init), source.observed_points)
    matches = method.match.prepare(*prepared)(placed)
    last = first = method.reject.prepare(*prepared)(matches, None)
    if hasattr(method.reject, "first_steps") and last.em_iterations > 1:
        first = replace(method.reject, first_steps=1).prepare(*prepared)(matches, None)
    return InlierField(
        source.on_grid(matches.distance),
        source.on_grid(first.z),
        source.on_grid(last.z),
        last.em_iterations,
    )


def registration_figure(
    source: PointCloud,
    target: PointCloud,
    result: RegistrationResult,
    path: str | os.PathLike[str],
    init: ArrayLike | None = None,
    field: InlierField | None = None,
    *,
    names: Names | None = None,
    method: str | None = None,
) -> None:
    """Draw what a registration did; the file appears whole or not at all.

    Above, the two clouds before and after (:func:`hmrf_icp.plot.before_after`). Below, with
    ``field`` and an organised source, maps in its own image: the initial distances and the
    inlier field at the first and the last EM step before the first motion (the paper's
    ex_frame). Otherwise the inliers, the distances and the convergence. The picture has no
    ground of its own, and ink that is read on white and on black.

    Parameters
    ----------
    source, target
        The clouds that were registered, in their own frames.
    result
        What came out.
    path
        PNG, PDF or SVG to write.
    init
        (4, 4) start that was given to ``register``; None for the identity.
    field
        As from ``field_before_first_step``.
    names, method
        What the clouds and the method are called in the title.

    Raises
    ------
    InputError
        The result or the field is not of the source's shape, the start is not
        rigid, or the file cannot be written there.
    """
    from hmrf_icp.io.whole import written_whole

    if result.correspondences.shape != source.shape:
        raise InputError(
            f"result: is of a source of shape {result.correspondences.shape}, this one has "
            f"{source.shape}"
        )
    if field is not None and field.distance.shape != source.shape:
        raise InputError(
            f"field: expected the source's shape {source.shape}, got {field.distance.shape}"
        )
    start = se3.as_rigid(init)

    figure = own_figure(*SIZE)
    # The clouds that the result was made of know their surfaces already.
    held = result.correspondences.clouds or (source, target)
    above = figure.add_axes((0.015, 0.46, 0.97, 0.47 if result.believed else 0.44))
    before_after(result, held[0], held[1], above, init=start, names=names, method=method)
    if source.organised and field is not None:
        _draw_field(figure, field)
    else:
        _draw_end(figure, source, result, held)
    with written_whole(path) as partial:
        figure.savefig(partial, dpi=DPI)


def _draw_field(figure: Figure, field: InlierField) -> None:
    """Draw the paper's figure ex_frame: Y, the field after the first EM step and the last."""
    panels = [figure.add_axes((0.015 + 0.33 * k, 0.09, 0.31, 0.29)) for k in range(3)]
    scale = _distances(field.distance)
    _map(panels[0], field.distance, scale, "Closest target point, at the start", "m", "max")
    for axes, z, step in (
        (panels[1], field.first, f"{min(1, field.steps)}"),
        (panels[2], field.last, f"{field.steps} (last)"),
    ):
        share = float(np.mean(z[~np.isnan(z)] > 0))
        title = f"Field, EM step {step}: {share:.0%} inliers"
        _map(axes, (1.0 + z) / 2.0, label_scale(), title, "probability of being an inlier")


def _draw_end(
    figure: Figure, source: PointCloud, result: RegistrationResult, held: tuple[Any, Any]
) -> None:
    """Draw what the result itself has: labels, distances, and how it came there."""
    left = figure.add_axes((0.015, 0.09, 0.31, 0.29))
    title = f"Inliers, {result.fitness:.0%} of the points"
    if source.organised:
        field(result, left, title=title)
    else:
        labels(result, held[0], held[1], left, title=title)
    middle = figure.add_axes((0.385, 0.09, 0.255, 0.29))
    residuals(result, middle, title="Distances at the end")
    if result.history:
        right = figure.add_axes((0.695, 0.09, 0.245, 0.29))
        state = "Converged" if result.converged else "Not converged"
        convergence(result, right, title=f"{state} after {count(result.iterations, 'iteration')}")
    for axes in figure.axes[2:]:
        axes.tick_params(labelsize=8)
        axes.xaxis.label.set_fontsize(8)
        axes.yaxis.label.set_fontsize(8)


def _map(
    axes: Axes,
    values: Array,
    scale: ScalarMappable,
    title: str,
    label: str,
    extend: str = "neither",
) -> None:
    """One image of the source, unobserved pixels hatched."""
    from hmrf_icp.figures.style import ink

    image_of(axes, values, scale)
    axes.set_title(title, loc="left", fontsize=9.5, fontweight="bold", color=ink(axes))
    colour_bar(axes, scale, label, extend)


def _distances(distance: Array) -> ScalarMappable:
    """Colours up to all but the farthest hundredth of the points."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    most = max(float(np.nanpercentile(distance, 99.0)), 1e-9)
    clear = (0.0, 0.0, 0.0, 0.0)
    return ScalarMappable(
        Normalize(0.0, most), colormaps[palette.UNSIGNED].with_extremes(bad=clear)
    )
