"""Where all distances are of one kind: the other component keeps what it was, and some weight."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import PointCloud, PreparedCloud
from hmrf_icp.field import mixture
from hmrf_icp.field.paper import HiddenMarkovRandomField
from hmrf_icp.loop.match import Matches


@pytest.mark.parametrize("precision", ["double", "single"])
def test_a_field_in_which_all_agree_for_certain_has_numbers(precision):
    image = PointCloud(np.random.default_rng(0).uniform(size=(12, 12, 3)))
    field = HiddenMarkovRandomField(beta=200.0, outliers=0.005, precision=precision)
    reject = field.prepare(PreparedCloud(image), PreparedCloud(image))
    distance = np.random.default_rng(1).uniform(0.9, 1.1, 144)
    first = reject(Matches(np.arange(144), distance), None)
    again = reject(Matches(np.arange(144), distance), first)
    for labels in (first, again):
        assert labels.inlier.all()
        assert np.isfinite(list(labels.parameters.values())).all()
        assert labels.parameters["mu_in"] == pytest.approx(distance.mean(), rel=1e-3)


def test_neither_component_of_a_mixture_vanishes():
    near = np.abs(np.random.default_rng(0).normal(0.0, 0.1, 2000))
    fitted = mixture.fit(near, "half-normal", "uniform")
    assert fitted.share <= 1.0 - mixture.SHARE_FLOOR
    all_but_none = mixture.fit(near, "half-normal", "half-normal")
    assert mixture.SHARE_FLOOR <= all_but_none.share <= 1.0 - mixture.SHARE_FLOOR
    assert mixture.SHARE_FLOOR > 1e-3
    # What is left to it is still told from what is not: a distance far beyond all is an outlier.
    assert fitted.probability(np.array([near.max()]))[0] < 0.5
