"""Pictures of a registration, for a notebook, a paper or a report.

Every function takes a result and, if need be, axes of matplotlib's to draw in, and returns the
axes. The title says how far the result is to be believed; one that is not has a hatched banner
and a frame in the colour of what cannot be. A colour means one thing in all of them
(:data:`MEANINGS`).

Examples
--------
>>> import numpy as np
>>> import hmrf_icp
>>> from hmrf_icp import plot
>>> from matplotlib.figure import Figure
>>> points = np.random.default_rng(0).uniform(-1.0, 1.0, size=(3000, 3))
>>> points[:, 2] = 0.2 * np.sin(4.0 * points[:, 0]) + 0.3 * np.cos(3.0 * points[:, 1])
>>> result = hmrf_icp.register(points - [0.02, 0.0, 0.01], points)
>>> ax = Figure().add_subplot()
>>> plot.residuals(result, ax) is ax
True
"""

from __future__ import annotations

from hmrf_icp.drawing.palette import MEANINGS
from hmrf_icp.figures.before_after import before_after
from hmrf_icp.figures.convergence import convergence
from hmrf_icp.figures.deviation import Deviations, deviation, deviations
from hmrf_icp.figures.film import animate
from hmrf_icp.figures.labels import field, labels
from hmrf_icp.figures.registration import registration_figure
from hmrf_icp.figures.residuals import residual_figure, residuals
from hmrf_icp.figures.states import Recording

__all__ = [
    "MEANINGS",
    "Deviations",
    "Recording",
    "animate",
    "before_after",
    "convergence",
    "deviation",
    "deviations",
    "field",
    "labels",
    "registration_figure",
    "residual_figure",
    "residuals",
]
