"""The picture of the distances shows the data, both components and their shares."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp.errors import InputError
from hmrf_icp.field import mixture
from hmrf_icp.figures.residuals import residual_figure


def test_the_figure_shows_what_was_fitted(tmp_path):
    rng = np.random.default_rng(0)
    y = np.concatenate([abs(rng.normal(0, 0.01, 800)), rng.uniform(0, 0.8, 1200)])
    y[3] = np.nan
    figure = residual_figure(y.reshape(40, 50), title="A pair")
    left, right = figure.axes
    labels = left.get_legend_handles_labels()[1]
    assert labels == ["distances", "41% inliers, half-normal", "59% outliers, uniform"]
    assert right.get_xscale() == "log"
    bars = left.patches[0].get_data()
    drawn = np.sum(bars.values * np.diff(bars.edges))
    assert drawn == pytest.approx(0.995, abs=0.01)
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5000


@pytest.mark.parametrize("y", [np.zeros(30), np.full(30, 0.2), np.array([0.0, 1e-9, 5.0])])
def test_odd_distances_have_a_figure_too(y, tmp_path):
    residual_figure(y, mixture.fit(y, "half-normal", "uniform")).savefig(tmp_path / "figure.png")


def test_nothing_to_draw_is_said():
    with pytest.raises(InputError, match="distances"):
        residual_figure(np.full(5, np.nan))
