"""What the search does with starts, candidates and ends, one part at a time."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import PreparedCloud, presets, se3
from hmrf_icp.search import coarse_to_fine, search
from hmrf_icp.search.search import Search, Starts
from hmrf_icp.search.visibility import Visibility
from views import frame, off, truth, turned

TRUE = truth(8, 0)


def begun(start=TRUE, near=True, plan=presets.ROBUST):
    return Search(plan, PreparedCloud(frame(8)), PreparedCloud(frame(0)), start, near, None)


@pytest.mark.parametrize(
    ("views", "near", "told"),
    [
        (True, True, [0.95]),
        (True, True, [0.8, 0.6]),
        (True, True, [0.4, 0.45, 0.6]),
        (True, False, [0.4, 0.45, 0.6]),
        (False, True, [0.6, 0.8, 0.95]),
        (False, False, [0.6, 0.7, 0.8]),
        (True, True, [0.1] * 4),
    ],
)
def test_the_search_goes_on_until_it_is_convinced_and_without_free_space_for_longer(
    monkeypatch, views, near, told
):
    calls = []

    class Told:
        def __init__(self, *arguments):
            pass

        def end(self):
            seen = Visibility(1, 0, 0, 0, 0, views=views)
            return SimpleNamespace(confidence=told[len(calls) - 1], visibility=seen, loop=None)

        def from_start(self):
            calls.append("start")
            return self.end()

        def farther(self):
            yield from range(3)

        def among(self, starts):
            calls.append(starts)
            return self.end()

        def no_worse(self, end):
            return end

        polished = no_worse

    monkeypatch.setattr(coarse_to_fine, "Search", Told)
    clouds = PreparedCloud(frame(8)), PreparedCloud(frame(0))
    result = presets.ROBUST.run(*clouds, np.eye(4), near)
    assert len(calls) == len(told)
    assert result.confidence == told[-1]


def asked_only(one):
    """A search that tells which candidates it would try, and anneals nothing."""
    one._gone_on = lambda candidates: candidates
    one._coarse = lambda poses, scale: poses
    return one


def test_the_given_start_is_a_candidate_and_six_of_its_turns():
    one = asked_only(begun())
    far = turned(TRUE, frame(8), [0.0, 1.0, 0.0], 90.0)
    one._close = SimpleNamespace(from_each_scale=lambda pose: far[None])
    candidates = one.from_start()
    np.testing.assert_array_equal(candidates[0].pose, TRUE)
    np.testing.assert_array_equal(candidates[1].pose, far)
    rng = np.random.default_rng(0)
    poses = np.array([se3.exp(0.3 * rng.standard_normal(6)) @ far for _ in range(30)])
    assert len(one.among(Starts(poses, 0, presets.ROBUST.finalists, False))) == 6


def about_the_truth(count, spread=0.05):
    rng = np.random.default_rng(0)
    return [se3.exp(spread * rng.standard_normal(6)) @ TRUE for _ in range(count)]


def test_the_candidates_are_those_for_which_most_speaks():
    far = turned(TRUE, frame(8), [0.0, 1.0, 0.0], 25.0, (0.0, 0.2, 0.2))
    kept = asked_only(begun()).among(Starts(np.array([far, *about_the_truth(5)]), 0, 3, False))
    assert len(kept) == 3
    assert not any(np.array_equal(candidate.pose, far) for candidate in kept)
    scores = [candidate.log_posterior for candidate in kept]
    assert scores == sorted(scores, reverse=True)


def test_of_many_poses_the_likeliest_are_held_against_the_views_for_longer():
    one = asked_only(begun())
    kept = one.among(Starts(np.array(about_the_truth(60)), 0, 3, False))
    for pose, log_posterior in kept:
        assert log_posterior == one._log_posterior(pose, one._test_early)
        assert log_posterior != one._log_posterior(pose, one._test_first)


def test_a_hopeless_end_is_not_run_to_the_end_before_others_were_looked_for():
    one = begun()
    _, (end,) = ends(0.0)
    hopeless = end._replace(visibility=replace(end.visibility, agree=10, front=900))
    one._tried = lambda candidates: [hopeless]
    one._refined = lambda: pytest.fail("run to the end")
    assert one._gone_on([]) is hopeless
    likely = begun()
    likely._tried = lambda candidates: [end]
    likely._refined = lambda: "run to the end"
    assert likely._gone_on([]) == "run to the end"


def test_near_a_start_a_pose_far_from_it_is_unlikely_and_from_nowhere_hardly_less_likely():
    far = turned(TRUE, frame(8), [0.0, 1.0, 0.0], 60.0)
    assert begun()._prior(far) < -4.0
    assert begun(near=False)._prior(far) > -1.0


def test_the_start_has_no_part_in_the_confidence():
    """From near and from far the same end is believed as much."""
    results = [
        hmrf_icp.register(frame(8), frame(0), turned(TRUE, frame(8), [1.0, 0.3, 0.2], degrees))
        for degrees in (0.0, 30.0)
    ]
    assert off(results[0].transformation, results[1].transformation, frame(8)) < 1e-3
    assert results[1].confidence == pytest.approx(results[0].confidence, abs=0.005)


def ends(*log_posteriors):
    """Ends of loops that differ in what speaks for them alone."""
    one = begun()
    loop = one._fine(TRUE, None, 1)
    base = one._judged(loop)
    return one, [base._replace(prior=odds - base.log_posterior) for odds in log_posteriors]


def test_the_end_for_which_most_speaks_is_chosen_and_the_next_tried_while_it_is_likelier():
    one, (low, high, highest) = ends(1.0, 3.0, 5.0)
    tried = []

    def worse(end, pose):
        """Refining the first makes it a little less likely than the second is."""
        tried.append(end)
        return end._replace(prior=end.prior - 3.0)

    one._continued, one._unmoved = worse, lambda end: end
    one._ends = [low, highest, high]
    best = one._refined()
    assert tried == [highest, high]
    assert best.log_posterior == pytest.approx(2.0, abs=1e-3)


def test_candidates_far_less_likely_than_an_end_are_not_tried_and_the_likeliest_goes_first():
    one = begun()
    tried = []
    _, (end,) = ends(4.0)

    def rough(pose, on_iteration, most):
        tried.append(pose[0, 3])
        assert most >= 5
        return pose

    one._rough = rough
    one._judged = lambda pose: end._replace(prior=end.prior + pose[0, 3])
    candidates = [
        search.Candidate(se3.rigid(np.eye(3), [odds, 0.0, 0.0]), odds) for odds in (1.0, 3.0, -2.0)
    ]
    one._same = lambda *pair: False
    found = one._tried(candidates)
    assert tried == [3.0, 1.0][: len(tried)]
    assert tried[0] == 3.0
    assert -2.0 not in tried
    assert len(found) == len(tried)


def test_going_back_along_what_is_free_is_given_up_where_evidence_is_against_it():
    one, (end,) = ends(4.0)
    free = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
    last = replace(end.loop.last, degenerate=free, weakest=0.0)
    end = end._replace(loop=replace(end.loop, last=last))
    for loses, kept in ((0.5, False), (3.0, True)):
        back = end._replace(prior=end.prior - loses)
        one._continued = lambda end, pose, back=back: back
        assert (one._unmoved(end) is end) is kept
    known = end._replace(loop=replace(end.loop, last=replace(last, weakest=0.9)))
    assert one._unmoved(known) is known


def test_last_steps_that_lead_away_are_not_taken(monkeypatch):
    def astray(loop, *rest):
        return replace(loop, transformation=se3.rigid(np.eye(3), [0.3, 0, 0]) @ loop.transformation)

    monkeypatch.setattr(search, "polish", astray)
    result = hmrf_icp.register(frame(8), frame(0), TRUE)
    assert off(result.transformation, TRUE, frame(8)) < 0.01


def test_the_history_is_of_all_that_led_to_the_pose():
    result = hmrf_icp.register(frame(8), frame(0), TRUE)
    numbers = [one.iteration for one in result.history]
    assert numbers == list(range(1, len(numbers) + 1))


def test_the_loop_sees_a_part_of_large_clouds_and_finalists_a_part_of_that():
    plan = replace(presets.ROBUST, points=2000)
    one = begun(plan=plan)
    assert len(one._source) <= 2000 * 1.1
    assert len(one._target) <= 2000 * 1.1
    assert len(one._rough._points) <= 500 * 1.1
    assert len(one._fine._points) == len(one._source)
