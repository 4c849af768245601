"""What the evidence for a pose is worth: what makes it likelier, and what bounds it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from hmrf_icp.search.confidence import confidence, log_odds
from hmrf_icp.search.visibility import Visibility

SEEN = Visibility(600, 6, 200, 180, 14)
UNSEEN = Visibility(600, 20, 0, 360, 20, views=False, facing=0.2, extent=0.5)


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_a_pose_that_much_speaks_for_is_believed(visibility):
    assert confidence(visibility, 20.0) > 0.9
    assert confidence(visibility) == confidence(visibility, 20.0)


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_the_more_contradicts_and_the_less_agrees_the_less_likely(visibility):
    for k in (2, 10, 50):
        worse = replace(
            visibility, front=k * visibility.front, outside=visibility.outside - visibility.front
        )
        assert log_odds(worse) < log_odds(visibility) - 0.5
        assert log_odds(replace(visibility, agree=visibility.agree // k)) < log_odds(visibility)


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_every_halving_of_what_agrees_tells_as_much_down_to_a_few_in_a_hundred(visibility):
    odds = [
        log_odds(replace(visibility, agree=agree, outside=1000 - agree))
        for agree in (640, 320, 160, 80, 40)
    ]
    lost = [one - other for one, other in pairwise(odds)]
    assert lost[0] > 0.8
    assert lost[-1] == pytest.approx(lost[0], rel=0.1)


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_hidden_points_and_those_outside_are_no_evidence(visibility):
    elsewhere = replace(visibility, behind=visibility.outside, outside=visibility.behind)
    assert log_odds(elsewhere) == pytest.approx(log_odds(visibility))


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_where_nothing_agrees_nothing_is_believed(visibility):
    assert confidence(replace(visibility, agree=0, front=0, outside=800)) < 0.3


def test_a_corner_that_agrees_is_little_though_nothing_contradicts_it():
    corner = Visibility(agree=200, front=1, behind=1500, outside=6300, other=0)
    tenth = Visibility(agree=800, front=1, behind=1500, outside=5700, other=0)
    assert confidence(corner) < 0.5
    assert confidence(tenth) > 0.8


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_of_two_poses_the_one_that_is_held_better_is_likelier(visibility):
    odds = [log_odds(visibility, weakest) for weakest in (0.1, 1.0, 5.0, 20.0, 100.0)]
    assert odds[0] < odds[1] < odds[2] < odds[3] == odds[4]


@pytest.mark.parametrize("visibility", [SEEN, UNSEEN])
def test_what_slides_is_not_believed_however_much_agrees(visibility):
    most = replace(visibility, agree=100_000, front=0, facing=1.0 / 3.0, extent=1.0)
    assert confidence(most, 20.0) > 0.95
    assert confidence(most, 0.2) < 0.5


@pytest.mark.parametrize("name", ["facing", "extent"])
def test_without_viewpoints_a_thin_layer_that_agrees_tells_little(name):
    odds = [log_odds(replace(UNSEEN, **{name: value})) for value in (0.0, 0.01, 0.1, 0.3)]
    assert odds == sorted(odds)
    assert odds[0] < odds[-1] - 4.0
    views = replace(SEEN, **{name: 0.0})
    assert log_odds(views) == log_odds(SEEN)


def test_without_viewpoints_normals_that_agree_by_chance_do_not_convince():
    by_chance = replace(UNSEEN, agree=300, other=1200, front=0, facing=1.0 / 3.0, extent=1.0)
    assert confidence(by_chance) < 0.5 < confidence(replace(by_chance, other=10))


def test_free_space_from_assumed_origins_tells_two_poses_apart_and_bounds_what_is_believed():
    likely = replace(UNSEEN, clear=5.0)
    unlikely = replace(UNSEEN, clear=2.5)
    assert log_odds(likely) > log_odds(UNSEEN) > log_odds(unlikely)
    surest = replace(UNSEEN, front=0, facing=1.0 / 3.0, extent=1.0, agree=20_000)
    assert confidence(surest) > 0.9
    assert confidence(replace(surest, clear=3.0)) < 0.5
