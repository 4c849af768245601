"""The intensity of a cloud's points: as the file has it, and as a function on the surface.

At each point the intensities of its neighbours are fitted by a plane over the tangent plane (Park,
Zhou and Koltun 2017): how bright it is there, how that changes along the surface, and, by what
the fit leaves over, how noisy it is. Texture finer than the points is noise, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.surface import Surface
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError
from hmrf_icp.stages import stage

Array = NDArray[np.float64]

NEIGHBOURS = 16
"""Points that an intensity is fitted to, itself among them."""

LUMA = (0.299, 0.587, 0.114)
"""Brightness of red, green and blue (ITU-R BT.601)."""

COLOURS = (
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
"""Names of a colour in three attributes, in any case."""

TRIPLES = ("colors", "colours", "color", "colour", "rgb")
"""Names of one in one attribute of three numbers, or four."""

SINGLE = ("intensity", "scalar_intensity", "reflectance", "reflectivity", "gray", "grey")
"""Names of a brightness."""

FLOOR = 1e-3
"""Smallest noise, as a share of the deviation of the intensities: exact ones have none."""


@dataclass(frozen=True, eq=False)
class Shading:
    """What can be told of the intensity at each observed point; rows as in ``observed_points``.

    Attributes
    ----------
    value
        (M,) intensity as it was measured; integers as shares of the largest that they hold. NaN
        where there is none.
    level
        (M,) the fit's, NaN where nothing could be fitted.
    slope
        (M, 3) its gradient along the surface, a metre.
    variance
        (M,) of the intensities about the fits.
    slope_variance
        (M,) of the slope along each tangent, a square metre.
    """

    value: Array
    level: Array
    slope: Array
    variance: Array
    slope_variance: Array


def intensity(cloud: PointCloud) -> Array | None:
    """Return the brightness (M,) of the observed points; None where the cloud has none.

    Integers are told as shares of the largest that their type holds, so that colours of 8
    and of 16 bits agree, and floating point as it is.
    """
    held = {name.lower(): name for name in cloud.attributes}

    def values(name: str) -> Array:
        found = cloud.attributes[held[name]][cloud.observed]
        scale = float(np.iinfo(found.dtype).max) if found.dtype.kind in "iu" else 1.0
        with np.errstate(invalid="ignore"):
            return np.asarray(found.astype(np.float64) / scale)

    for names in COLOURS:
        if all(name in held and values(name).ndim == 1 for name in names):
            return np.asarray(sum(w * values(n) for w, n in zip(LUMA, names, strict=True)))
    for name in TRIPLES:
        if name in held and (found := values(name)).ndim == 2 and found.shape[1] in (3, 4):
            return np.asarray(found[:, :3] @ np.array(LUMA))
    for name in SINGLE:
        if name in held and (found := values(name)).size == len(cloud):
            return np.asarray(found.reshape(-1))
    return None


@stage("shading")
def shading(cloud: PointCloud, surface: Surface, tree: Tree) -> Shading:
    """Fit the intensity round every point.

    Raises
    ------
    InputError
        The cloud has no colours, or none that are finite.
    """
    from hmrf_icp.kernels.compiled import read_only
    from hmrf_icp.kernels.shading import fit_shading

    value = intensity(cloud)
    if value is None:
        has = ", ".join(cloud.attributes) or "nothing beside its points"
        raise InputError(
            "no colours: expected attributes red, green and blue, or intensity, and it has "
            f"{has}; read a file with colours, or register without them"
        )
    value = np.where(np.isfinite(value), value, np.nan)
    if np.isnan(value).all():
        raise InputError("no colours: none of its intensities is finite")
    points = surface.points
    _, index = tree.query(points, k=min(NEIGHBOURS, len(points)))
    index = np.ascontiguousarray(index.reshape(len(points), -1), dtype=np.int64)
    level, slope, left, share = fit_shading(
        read_only(points), read_only(surface.normals), read_only(value), index
    )
    fitted = np.isfinite(left)
    usual = float(np.median(left[fitted])) if fitted.any() else 0.0
    least = (FLOOR * float(np.nanstd(value))) ** 2
    # Few neighbours tell little of the noise: half of it is what is usual in the cloud.
    variance = 0.5 * (np.where(fitted, left, usual) + usual) + least
    return Shading(value, level, slope, variance, variance * share)
