"""How far a scan is from a model: measured along the model's normals, drawn on the scan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp import se3
from hmrf_icp.clouds.cloud import PointCloudLike
from hmrf_icp.clouds.prepared import PreparedCloud
from hmrf_icp.clouds.range_image import BAND
from hmrf_icp.drawing import palette
from hmrf_icp.errors import InputError
from hmrf_icp.figures.labels import colour_bar
from hmrf_icp.figures.pair import Pair
from hmrf_icp.figures.style import Lengths, Names, above, axes_or_new, entitled, ink, legend
from hmrf_icp.figures.view import View, box_of, show
from hmrf_icp.result import RegistrationResult
from hmrf_icp.se3 import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BESIDE = 1.5
"""Spacings of the target that a point may be beside its closest point, along the surface."""

LEANING = 0.25
"""The same as a share of its distance: normals that are fitted lean a little. What is farther
beside has no surface across from it: it is past a border or an edge of the target."""

SHOWN = 90.0
"""Percentile of the deviations that the colours reach to, or twice the tolerance: parts that the
target did not see may lie far from all that it saw, and would take up the whole scale."""


@dataclass(frozen=True, eq=False)
class Deviations:
    """How far the source's points are from the target's surface.

    Attributes
    ----------
    values
        (M,) one for each observed point of the source, in the unit of the clouds; NaN where the
        target has no surface to compare with. In front of the surface, where its normals point
        to, they are positive; where normals have no sign, all are.
    signed
        Whether they have a sign.
    tolerance
        What counts as no deviation: as it was given, or from the noise of both clouds.
    chosen
        Whether it was chosen from the noise.
    """

    values: Array
    signed: bool
    tolerance: float
    chosen: bool

    @property
    def compared(self) -> NDArray[np.bool_]:
        """(M,) which points have a surface to be compared with."""
        return np.asarray(~np.isnan(self.values))

    @property
    def share_within(self) -> float:
        """Share of the points compared whose deviation is the tolerance at most; NaN of none."""
        values = self.values[self.compared]
        return float(np.mean(np.abs(values) <= self.tolerance)) if values.size else math.nan


def deviations(
    result: RegistrationResult,
    source: PreparedCloud | PointCloudLike | None = None,
    target: PreparedCloud | PointCloudLike | None = None,
    *,
    tolerance: float | None = None,
    reach: float | None = None,
) -> Deviations:
    """Measure how far the source, where it ended, is from the surface of the target.

    Along the normal of the closest target point: the normals that the target came with, or
    those towards its sensor. Without either the deviations have no sign. A source point that has
    no surface of the target across from it, past its border, is compared with nothing.

    Parameters
    ----------
    result, source, target
        As for :func:`hmrf_icp.plot.before_after`: the scan is the source, the model the target.
    tolerance
        What counts as no deviation, in the unit of the clouds; None chooses four standard
        deviations of the noise of both clouds together.
    reach
        Deviation from which a point is of another surface, one that the target does not have,
        and is compared with nothing; None for no limit. Views that share only a part want one.

    Raises
    ------
    InputError
        The tolerance or the reach is not positive, or the clouds are missing or others.

    Examples
    --------
    >>> import numpy as np
    >>> import hmrf_icp
    >>> from hmrf_icp import plot
    >>> points = np.random.default_rng(0).uniform(-1.0, 1.0, size=(3000, 3))
    >>> points[:, 2] = 0.2 * np.sin(4.0 * points[:, 0]) + 0.3 * np.cos(3.0 * points[:, 1])
    >>> result = hmrf_icp.register(points - [0.02, 0.0, 0.01], points)
    >>> found = plot.deviations(result, tolerance=0.001)
    >>> found.values.shape, found.share_within
    ((3000,), 1.0)
    """
    for name, length in (("tolerance", tolerance), ("reach", reach)):
        if length is not None and not (math.isfinite(length) and length > 0.0):
            raise InputError(f"{name}: expected a positive length, got {length}")
    return _deviations(Pair.of(result, source, target), tolerance, reach)


def _deviations(pair: Pair, tolerance: float | None, reach: float | None) -> Deviations:
    surface, given = pair.target.surface, pair.target.cloud.normals
    points = se3.transform(pair.pose, pair.source.points)
    distance, near = pair.target.tree.query(np.ascontiguousarray(points))
    near = near.astype(np.intp)
    normals, signed = surface.normals, surface.oriented
    if given is not None:
        normals, signed = _unit(given[pair.target.cloud.observed]), True
    along = ((points - surface.points[near]) * normals[near]).sum(axis=1)
    value = along if signed else np.abs(along)
    beside = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    across = beside <= BESIDE * np.sqrt(surface.area[near]) + LEANING * np.abs(along)
    across &= np.abs(normals[near]).sum(axis=1) > 0.0  # where there is no normal there is no side
    if reach is not None:
        across &= np.abs(along) <= reach
    value = np.where(across, value, np.nan)
    if tolerance is not None:
        return Deviations(value, signed, float(tolerance), False)
    noise = np.hypot(pair.source.surface.noise, surface.noise[near])[across]
    chosen = BAND * float(np.median(noise)) if noise.size else 0.0
    return Deviations(value, signed, max(chosen, float(np.finfo(float).tiny)), True)


def deviation(
    result: RegistrationResult,
    source: PreparedCloud | PointCloudLike | None = None,
    target: PreparedCloud | PointCloudLike | None = None,
    ax: Axes | None = None,
    *,
    tolerance: float | None = None,
    reach: float | None = None,
    names: Names | None = None,
    method: str | None = None,
    unit: str | None = "m",
    title: str | None = None,
) -> Axes:
    """Draw a deviation map: the source by how far it is from the target's surface.

    Millimetres where the clouds are in metres. The title says which share of the points that
    can be compared is within the tolerance; two lines on the colour bar show this.

    Parameters
    ----------
    result, source, target, names, method, unit, title
        As for :func:`hmrf_icp.plot.before_after`.
    ax
        Axes to draw in; None for a new figure of pyplot's.
    tolerance, reach
        As for :func:`deviations`, which has the numbers.

    Returns
    -------
    The axes.

    Raises
    ------
    InputError
        As :func:`deviations`.
    """
    found = deviations(result, source, target, tolerance=tolerance, reach=reach)
    pair, lengths = Pair.of(result, source, target), Lengths(unit)
    factor, name = lengths.short
    ax = axes_or_new(ax, 6.4, 5.6, (0.1, 0.9, above(result)))
    scale = _scale(found, factor)
    view = View.of(pair)
    width, height = box_of(ax)
    limits = view.limits([pair.pose], width / max(height, 1.0), target=False)
    values = found.values[view.kept]
    colours = np.asarray(scale.to_rgba(factor * values)[:, :3])
    colours[np.isnan(values)] = palette.rgb(palette.OUTLIER)
    show(ax, [(view.moving.moved(pair.pose), colours)], view.frame, limits, lengths)
    kind = "deviation from the target" if found.signed else "distance from the target"
    bar = colour_bar(ax, scale, f"{kind}, {name}", extend="both" if found.signed else "max")
    for edge in (-found.tolerance, found.tolerance) if found.signed else (found.tolerance,):
        bar.ax.axvline(
            factor * edge, color=ink(ax), linewidth=1.4, ymin=-0.4, ymax=1.4, clip_on=False
        )
    if not found.compared.all():
        words = f"nothing to compare with ({np.mean(~found.compared):.0%})"
        legend(ax, [(palette.OUTLIER, words)], below=-0.17)
    entitled(ax, result, _words(found, lengths), names, method, title)
    return ax


def _words(found: Deviations, lengths: Lengths) -> str:
    """Say the share within the tolerance, and where the tolerance comes from."""
    if not found.compared.any():
        return "Deviation: nothing to compare"
    whence = ", from the noise" if found.chosen else ""
    return f"Deviation: {found.share_within:.1%} within {lengths.text(found.tolerance)}{whence}"


def _scale(found: Deviations, factor: float) -> Any:
    """Colours up to nearly the largest deviation, and beyond the tolerance in any case."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    sizes = np.abs(found.values[found.compared])
    most = float(np.percentile(sizes, SHOWN)) if sizes.size else 0.0
    most = factor * max(most, 2.0 * found.tolerance)
    low = -most if found.signed else 0.0
    if not found.signed:
        return ScalarMappable(Normalize(low, most), colormaps[palette.UNSIGNED])
    # Its ends are lost on a black ground and on a white one.
    cmap = ListedColormap(colormaps[palette.SIGNED](np.linspace(0.08, 0.92, 256)))
    return ScalarMappable(Normalize(low, most), cmap)


def _unit(vectors: Array) -> Array:
    """Vectors (M, 3) of length one; zero where there is none."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.nan_to_num(vectors / length, posinf=0.0, neginf=0.0))
