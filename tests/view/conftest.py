from __future__ import annotations

import warnings

import numpy as np
import pytest

import hmrf_icp
from hmrf_icp.cli.demo import desk_pair
from hmrf_icp.view import Recording, story


@pytest.fixture(scope="session")
def pair():
    """Two views of a desk, 80 x 60."""
    return desk_pair(subsample=8)


@pytest.fixture(scope="session")
def recording():
    return Recording()


@pytest.fixture(scope="session")
def found(pair, recording):
    """The pair registered from nowhere, which tries several candidates."""
    return hmrf_icp.register(pair.source, pair.target, on_iteration=recording)


@pytest.fixture(scope="session")
def told(pair, recording, found):
    return story(found, None, recording, pair.truth, ("shelf.png", "desk.png"))


@pytest.fixture(scope="session")
def wrong(pair):
    """The same near a start from which it is not found."""
    start = np.diag([-1.0, -1.0, 1.0, 1.0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hmrf_icp.RegistrationWarning)
        few = pair.source.subsample(2), pair.target.subsample(2)
        result = hmrf_icp.register(*few, start)
    assert not result.believed
    return story(result, start, None, pair.truth)
