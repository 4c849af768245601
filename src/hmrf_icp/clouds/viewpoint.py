"""Where a cloud was seen from, told from its points alone, and how far to believe it.

Two things single out the place of a sensor. The points of one view hide each other from
nowhere but the place that they were seen from: anywhere else, what stood behind shows through
what stood in front. And a sensor looks the same way into every direction, pixel by pixel or beam
by beam: from its place, and from no other, the points lie evenly over the directions, whatever
their distance and the slope of their surface. A cloud that was thinned has lost the second, one
that was fused from many places both; one surface that hides nothing has only the second.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmrf_icp.clouds.cloud import each
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.errors import InputError
from hmrf_icp.lazy import cached_property
from hmrf_icp.stages import stage

Array = NDArray[np.float64]
Source = Literal["given", "recovered", "origin", "none"]

POINTS, FEW = 10_000, 2_500
"""Points that are looked at: to weigh a place, and to look for one."""

FEWEST = 200
"""Observed points without which nothing is said."""

NEIGHBOURS = 10
"""Neighbours, itself included, that tell the area a point stands for."""

FLAT = 0.1
"""Ratio of the two smallest variances of the neighbours below which they are a surface."""

MARGIN = 1.5
"""Spacings of both points by which one must be behind the other to count as hidden."""

BESIDE = 0.2
"""How far the places stand that a place is compared with, as a share of the cloud's size."""

PSEUDO = 0.01
"""Added to every share of hidden points: few points more or less are no evidence."""

STARTS = (2.0, 0.7)
"""Distances from the centre, in sizes, from which places are looked for."""

SHADOWS = 0.5
"""What the hidden points count for when a place is looked for, beside the unevenness."""

BELIEVED = 0.8
"""Weight from which a place counts as known."""

CONSTANT, HIDDEN, CONTRAST = -2.27, -0.27, 5.74
"""Log-odds of a place: alone, for each e-fold of hidden points, and for each e-fold more of them
beside the place. A logistic regression on depth maps, LiDAR scans, fused and closed clouds and
random ones, every kind counting the same."""

DOUBTED, HIDES = 0.4, 0.03
"""Weight below which a place that was given is doubted, and share that is hidden from it at the
least: where hardly a point is hidden, nothing speaks against it. Places where sensors stood
have a weight of 0.66 to 1 (sparse LiDAR 0.24 to 0.38), those a tenth of the size off 0.31 to 1, and
three in four of those that were left behind when the cloud was moved have less than 0.25.
"""

CHECKED = 3000
"""Points that tell whether a place that was given is to be doubted."""

DIRECTIONS = np.array(
    [
        (x, y, z)
        for x in (-1.0, 0.0, 1.0)
        for y in (-1.0, 0.0, 1.0)
        for z in (-1.0, 0.0, 1.0)
        if abs(x) + abs(y) + abs(z) in (1.0, 3.0)
    ]
)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
"""Ways to go from a place: to the faces and the corners of a cube."""

CORNERS = DIRECTIONS[np.abs(DIRECTIONS).max(axis=1) < 0.9]


@dataclass(frozen=True)
class Evidence:
    """What speaks for a place.

    Attributes
    ----------
    hidden
        Share of the points that others hide from there.
    beside
        The same from places a little off, on average.
    uneven
        How unevenly the points lie over the directions from there, as a share of how
        unevenly they lie over the surface.
    """

    hidden: float
    beside: float
    uneven: float

    @property
    def weight(self) -> float:
        """Probability that the cloud was seen from there."""
        clear = math.log(self.hidden + PSEUDO)
        contrast = math.log(self.beside + PSEUDO) - clear
        odds = CONSTANT + HIDDEN * clear + CONTRAST * contrast
        return 1.0 / (1.0 + math.exp(-min(max(odds, -30.0), 30.0)))


class Seeing:
    """A cloud as its points are held against places: surface, spacing, size."""

    def __init__(self, points: Array, most: int = POINTS) -> None:
        from hmrf_icp.kernels.surface import fit_neighbours

        some = points
        if len(points) > most:
            draw = np.random.default_rng(0).choice
            some = points[draw(len(points), most, replace=False, shuffle=False)]
        self.points = np.ascontiguousarray(some, dtype=np.float64)
        count = min(NEIGHBOURS, len(self.points))
        distance, index = Tree(self.points).query(self.points, k=count)
        self.centre = self.points.mean(axis=0)
        self.size = float(np.sqrt(((self.points - self.centre) ** 2).sum(axis=1).mean()))
        distance, index = distance.reshape(-1, count), index.reshape(-1, count)
        of, counts = np.arange(len(self.points)), np.array([count])
        self.normals, off, *_ = fit_neighbours(
            self.points, index.astype(np.int64), distance, of, counts, self.centre
        )
        area = np.maximum(np.pi * distance[:, -1] ** 2 / count, 1e-12 * self.size**2)
        self.spacing = np.sqrt(area)
        surface = np.flatnonzero((self.normals != 0.0).any(axis=1) & (off < FLAT * self.spacing))
        if len(surface) < FEWEST:
            surface = np.arange(len(self.points))
        surface = surface[:: max(1, len(surface) // FEW)]
        self._flat = self.points[surface], self.normals[surface], np.log(area[surface])
        logs = self._flat[2]
        self._over_surface = max(1.4826 * float(np.median(np.abs(logs - np.median(logs)))), 1e-3)
        self._drawings: dict[int, tuple[NDArray[np.float32], NDArray[np.int32]]] = {}

    @cached_property
    def few(self) -> tuple[Array, Array, Array]:
        """Fewer points, their normals and how far apart those are."""
        step = max(1, len(self.points) // FEW)
        wider = math.sqrt(step)
        return self.points[::step], self.normals[::step], self.spacing[::step] * wider

    def uneven(self, place: Array) -> float:
        """How unevenly the points lie over the directions."""
        from hmrf_icp.kernels.evenness import unevenness

        return float(unevenness(*self._flat, place)) / self._over_surface

    def hidden(self, place: Array, few: bool = False) -> float:
        """Share of the points that others hide."""
        from hmrf_icp.kernels.hidden import count_hidden

        points, normals, spacing = self.few if few else (self.points, self.normals, self.spacing)
        reach = np.linalg.norm(points[::5] - place, axis=1)
        angle = float(np.median(spacing[::5] / np.maximum(reach, 1e-12 * self.size)))
        cells = min(512, 2 ** math.ceil(math.log2(max(8.0, 4.0 / angle))))
        if cells not in self._drawings:
            shape = (6, cells, cells)
            self._drawings[cells] = np.empty(shape, np.float32), np.zeros(shape, np.int32)
        count = count_hidden(points, normals, spacing, place, MARGIN, *self._drawings[cells])
        return float(count) / len(points)

    def evidence(self, place: Array) -> Evidence:
        """Say what speaks for a place."""
        hidden = self.hidden(place)
        ways = place + BESIDE * self.size * CORNERS
        beside = np.array([self.hidden(way) for way in ways])
        return Evidence(hidden, float(beside.mean()), self.uneven(place))

    def sought(self) -> tuple[Array, Evidence]:
        """Find the place for which most speaks: coarse to fine, from many places at once."""
        around = [self.centre + far * self.size * way for far in STARTS for way in DIRECTIONS]
        starts = [self.centre, *around]
        step = 0.5 * self.size
        even = [_descended(self.uneven, start, step, 0.05 * self.size) for start in starts[:15]]
        clear = sorted(starts, key=lambda place: self.hidden(place, few=True))[:3]
        ends = [*distinct(even, 0.2 * self.size), *clear]
        ends = sorted(ends, key=lambda place: self._cost(place, few=True))[:4]
        ends = [
            _descended(lambda p: self._cost(p, few=True), end, 0.2 * self.size, 0.05 * self.size)
            for end in distinct(ends, 0.1 * self.size)
        ]
        ends = sorted(distinct(ends, 0.05 * self.size), key=self._cost)[:2]
        fine = [_descended(self._cost, end, 0.05 * self.size, 0.01 * self.size) for end in ends]
        judged = [(place, self.evidence(place)) for place in fine]
        return max(judged, key=lambda one: one[1].weight)

    def _cost(self, place: Array, few: bool = False) -> float:
        """Return what is small at the place of a sensor."""
        return math.log(self.uneven(place)) + SHADOWS * math.log(self.hidden(place, few) + PSEUDO)


def _descended(cost: Callable[[Array], float], place: Array, step: float, least: float) -> Array:
    """Go downhill along the directions of a cube, with steps that are halved where none helps."""
    best = cost(place)
    while step >= least:
        for way in DIRECTIONS:
            value = cost(place + step * way)
            if value < best:
                best, place = value, place + step * way
                break
        else:
            step *= 0.5
    return place


def distinct(places: Sequence[Array], apart: float) -> list[Array]:
    """Leave out places that are closer than ``apart`` to one before."""
    kept: list[Array] = []
    for place in places:
        if all(float(np.linalg.norm(place - other)) > apart for other in kept):
            kept.append(place)
    return kept


def _seeing(points: Array, most: int = POINTS) -> Seeing | None:
    """Hold points against places; None where they are too few, or all at one place."""
    seeing = Seeing(points, most) if len(points) >= FEWEST else None
    return None if seeing is None or not np.ptp(seeing.points, axis=0).any() else seeing


@stage("viewpoint")
def doubt(points: Array, place: Array) -> Evidence | None:
    """Say what speaks against a place (3,) that was given with points (N, 3); None if little does.

    A cloud that is moved leaves its viewpoint behind where nobody moves it too.
    """
    seeing = _seeing(points, CHECKED)
    if seeing is None or seeing.hidden(place) <= HIDES:
        return None
    evidence = seeing.evidence(place)
    return evidence if evidence.weight < DOUBTED else None


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A place that a cloud may have been seen from.

    Attributes
    ----------
    place
        (3,) in the cloud's frame, metres: the likeliest there is, even where ``source`` is "none".
    weight
        Probability that free space can be told from there, 0 to 1.
    source
        ``"given"``; ``"origin"`` of the cloud's frame; ``"recovered"`` from the points; or
        ``"none"``, where no place can be believed.
    evidence
        What it is told by, None where the place was given or nothing could be told.
    """

    place: Array
    weight: float
    source: Source
    evidence: Evidence | None = None

    @property
    def known(self) -> Array | None:
        """(3,) the place, or None where it is not to be believed."""
        return None if self.source == "none" else self.place

    @property
    def text(self) -> str:
        """What is known, in a line."""
        if self.source == "given":
            return "viewpoint: given"
        if self.evidence is None:
            return "viewpoint: none (too few points)"
        at = "the origin" if not self.place.any() else " ".join(f"{x:.4g}" for x in self.place)
        how = {"origin": "", "recovered": ", recovered", "none": ", not believed"}[self.source]
        return (
            f"viewpoint: {at}{how} (weight {self.weight:.2f}: {self.evidence.hidden:.1%} of the "
            f"points hidden, {self.evidence.beside:.1%} from beside)"
        )


def viewpoint_of(
    points: ArrayLike, given: ArrayLike | Literal["auto"] | None = "auto", anywhere: bool = False
) -> Viewpoint:
    """Tell where points were seen from.

    Parameters
    ----------
    points
        (N, 3) or (H, W, 3) metres; not finite where nothing was seen.
    given
        (3,) the place where it is known, which ends the matter; ``"auto"`` to tell it by the
        points, the origin of their frame first; None to say that there is none.
    anywhere
        Whether to look for a place where the origin is none: ten times as long, and the place
        is off by a tenth of the size as often as not, most of it along the line of sight.

    Raises
    ------
    InputError
        ``given`` is something else.
    """
    if given is None:
        return Viewpoint(np.zeros(3), 0.0, "none")
    if not isinstance(given, str):
        place = np.array(given, dtype=np.float64)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise InputError(f"viewpoint: expected three finite numbers, got {given}")
        return Viewpoint(place, 1.0, "given")
    if given != "auto":
        raise InputError(f'viewpoint: expected "auto", None or three numbers, got {given!r}')
    rows = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    seen = each(np.isfinite(rows))
    rows = rows if seen.all() else rows[seen]
    seeing = _seeing(rows)
    if seeing is None:
        return Viewpoint(np.zeros(3), 0.0, "none")
    origin = Viewpoint(np.zeros(3), 0.0, "none", seeing.evidence(np.zeros(3)))
    assert origin.evidence is not None
    origin = replace(origin, weight=origin.evidence.weight)
    if origin.weight >= BELIEVED:
        return replace(origin, source="origin")
    if not anywhere:
        return origin
    place, evidence = seeing.sought()
    if evidence.weight >= BELIEVED and evidence.weight > origin.weight:
        return Viewpoint(place, evidence.weight, "recovered", evidence)
    return origin
