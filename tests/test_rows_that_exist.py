"""No compiled loop is handed a row, or a number, that would lead it out of its arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
import synthetic
from hmrf_icp import InputError, PreparedCloud
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.tree import Tree
from hmrf_icp.field.graph import PixelGrid, nearest_graph
from hmrf_icp.loop.icp import Loop, Method
from hmrf_icp.loop.match import Matches, NearestNeighbour
from hmrf_icp.loop.placed import Placed
from hmrf_icp.loop.reject import KeepAll, Labels
from shapes import both

POINTS = np.random.default_rng(0).normal(size=(300, 3))
ALIGNERS = ("point-to-point", "point-to-plane", "symmetric", "plane-to-plane")


class Matcher:
    """A matcher of somebody else's, which answers what it was told to."""

    def __init__(self, index, distance=None, evidence=None):
        self._answer = Matches(
            index, np.zeros(len(index)) if distance is None else distance, evidence
        )

    def prepare(self, source, target):
        return lambda placed: self._answer


ROWS = np.arange(300)
WRONG = {
    "beyond the end": Matcher(np.full(300, 10**9)),
    "the next after the last": Matcher(np.where(ROWS == 7, 300, 0)),
    "before the start": Matcher(np.where(ROWS == 7, -1, 0)),
    "too few": Matcher(ROWS[:-1]),
    "too many": Matcher(np.r_[ROWS, 0]),
    "fractions": Matcher(ROWS.astype(float)),
    "no distance": Matcher(ROWS, np.full(300, np.nan)),
    "infinite distance": Matcher(ROWS, np.full(300, np.inf)),
    "negative distance": Matcher(ROWS, np.full(300, -1.0)),
    "too few distances": Matcher(ROWS, np.zeros(299)),
    "evidence that is none": Matcher(ROWS, None, np.full(300, np.nan)),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_a_matcher_answers_is_looked_at(wrong):
    method = Method(WRONG[wrong], KeepAll(), hmrf_icp.Symmetric())
    with pytest.raises(InputError, match="matches"):
        hmrf_icp.register(POINTS, POINTS, preset=method)


@pytest.mark.parametrize("aligner", ALIGNERS)
@pytest.mark.parametrize("row", [300, -1, 2**40])
def test_a_metric_looks_at_the_rows_it_is_given(aligner, row):
    source, target = both(PointCloud(POINTS), PointCloud(POINTS))
    align = hmrf_icp.presets.aligner(aligner).prepare(source, target)
    matches = Matches(np.where(ROWS == 3, row, 0), np.ones(300))
    with pytest.raises(InputError, match="rows of the target"):
        align(Placed.at(np.eye(4), source.points), matches, Labels(np.ones(300)))


@pytest.mark.parametrize("aligner", ALIGNERS[1:])
def test_a_metric_looks_at_the_number_of_labels(aligner):
    source, target = both(PointCloud(POINTS), PointCloud(POINTS))
    align = hmrf_icp.presets.aligner(aligner).prepare(source, target)
    with pytest.raises(InputError, match="labels"):
        align(Placed.at(np.eye(4), source.points), Matches(ROWS, np.ones(300)), Labels(np.ones(3)))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e200])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("k", [1, 4])
def test_a_tree_is_asked_for_places_that_exist(value, axis, k):
    asked = np.zeros((5, 3))
    asked[2, axis] = value
    with pytest.raises(InputError, match="finite"):
        Tree(POINTS).query(asked, k=k)


def test_a_tree_answers_in_one_shape():
    for count in (1, 2, 300):
        tree = Tree(POINTS[:count])
        for k in (1, min(2, count)):
            distance, row = tree.query(POINTS[:7], k=k)
            assert distance.shape == row.shape == ((7,) if k == 1 else (7, k))
            assert row.max() < count
    assert Tree(POINTS).query(np.empty((0, 3)))[0].shape == (0,)
    for wrong in (np.empty((0, 3)), POINTS[:, :2], np.full((4, 3), np.nan)):
        with pytest.raises(InputError):
            Tree(wrong)
    with pytest.raises(InputError, match="301"):
        Tree(POINTS).query(POINTS, k=301)


@pytest.mark.parametrize("pose", [np.full((4, 4), np.nan), np.eye(3), np.diag([1, 1, 1, np.inf])])
def test_the_loop_starts_from_a_pose(pose):
    method = Method(NearestNeighbour(), KeepAll(), hmrf_icp.PointToPoint())
    loop = Loop(*both(PointCloud(POINTS), PointCloud(POINTS)), method)
    with pytest.raises(InputError, match="init"):
        loop(pose)


@pytest.mark.parametrize("graph", [nearest_graph(POINTS), PixelGrid(np.ones((15, 20), bool))])
@pytest.mark.parametrize("update", ["simultaneous", "sequential"])
def test_a_field_takes_one_number_a_point(graph, update):
    one, right = np.ones(1), np.ones(300)
    for log_odds, z in ((one, right), (right, one), (right, np.ones(301))):
        with pytest.raises(InputError, match="one a point"):
            graph.steps(log_odds, z, one, update, -1.0)
    with pytest.raises(InputError, match="one number a step"):
        graph.steps(right, right, np.ones((2, 2)), update, -1.0)
    with pytest.raises(InputError, match="one a point"):
        graph.sums(one)


def test_a_view_is_asked_about_points_with_normals():
    source, _ = synthetic.pair()
    cloud = PreparedCloud(PointCloud(source, viewpoint=(0.0, 0.0, 0.0)))
    view, surface = cloud.range_image, cloud.surface
    with pytest.raises(InputError, match="normals"):
        view.ask(surface.points, surface.normals[:-1], np.eye(4))
    with pytest.raises(InputError, match="pose"):
        view.ask(surface.points, surface.normals, np.eye(3))
    for pose in (np.full((4, 4), np.nan), np.full((4, 4), 1e300), np.zeros((4, 4))):
        assert view.ask(surface.points, surface.normals, pose).max() <= 4
    with pytest.raises(InputError, match="points that were seen"):
        replace(view, row=np.where(view.row >= 0, 10**6, -1).astype(np.int32))
    with pytest.raises(InputError, match="one shape"):
        replace(view, tolerance=view.tolerance[:-1])
