"""The search near a start: what only turns, shifts, the second candidate or all of it find."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp import presets
from views import frame, off, truth, turned

SIZE = 1.5
"""About the size of what the views show, metres."""


def found(pair, axis, degrees, shift, scene="desk", **options):
    """Register a pair from a start that is off by so much; how far off the end is, and it."""
    source, target = (frame(k, scene) for k in pair)
    true = truth(*pair, scene)
    start = turned(true, source, axis, degrees, shift)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
        result = hmrf_icp.register(source, target, start, **options)
    return off(result.transformation, true, source), result


TURNED = ((48, 30), (-0.18, -0.21, 0.7), 45.0, (0.09, -0.18, -0.01))
"""A pair that shares four tenths, from a start that only the turns of it lead to the pose."""

SHIFTED = [
    ((40, 20), (0.16, -0.19, -2.52), 38.0, (-0.49, -0.04, 0.1)),
    ((59, 44), (-0.69, -0.33, -0.56), 20.0, (0.01, -0.62, -0.5)),
]
"""Pairs from starts from which no turn leads to the pose: the search goes wider."""


def test_a_start_far_turned_is_found_by_its_turns():
    apart, result = found(*TURNED)
    assert apart < 0.01
    assert result.believed
    unturned = replace(presets.ROBUST, turn=0.0)
    assert found(*TURNED, preset=unturned)[0] > 0.1


@pytest.mark.parametrize("start", SHIFTED)
def test_a_start_from_which_no_turn_leads_there_is_found_by_the_wider_search(start):
    apart, result = found(*start)
    assert apart < 0.01
    assert result.believed
    # With shifts of nothing, the wider search is the narrow one once more.
    unshifted = replace(presets.ROBUST, shift=0.0)
    assert found(*start, preset=unshifted)[0] > 0.1


def counted(*start, **options):
    """How many registrations were begun, and how many iterations they had."""
    seen = []
    found(*start, on_iteration=lambda one: seen.append(one.iteration), **options)
    return seen.count(1), len(seen)


def test_what_convinces_ends_the_search_and_spares_the_others():
    begun, iterations = counted((8, 0), (1.0, 0.2, 0.1), 5.0, (0.02, 0.0, 0.0))
    # The likeliest candidate, on fewer points for a few iterations, and from there to the end.
    assert begun == 1
    assert iterations < 30


def test_candidates_that_lead_to_one_place_are_tried_once():
    """The start is the pose: the likeliest leads there, and nearly all that is left as well."""
    begun, _ = counted((26, 8), (1.0, 0.2, 0.1), 0.0, (0.0, 0.0, 0.0))
    assert begun <= 3
    assert np.isfinite(SIZE)
