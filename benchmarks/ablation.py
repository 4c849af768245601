r"""What the random field, its neighbours and its evidence are worth, judge by judge.

    cd benchmarks
    python nowhere.py ../../shared/data --output ablation.csv --starts none,pi/10 \
        --known-starts none,pi/10 --methods robust,ablation:without_field,\
    ablation:without_neighbours,ablation:without_evidence

Each function registers as the default does with one part of it taken away.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import hmrf_icp
from hmrf_icp import presets
from hmrf_icp.loop.reject import KeepAll
from hmrf_icp.search.visible_match import VisibleMatch


def without_field(source: Any, target: Any, init: Any) -> hmrf_icp.RegistrationResult:
    """Take every match for an inlier."""
    return hmrf_icp.register(source, target, init, rejector=KeepAll())


def without_neighbours(source: Any, target: Any, init: Any) -> hmrf_icp.RegistrationResult:
    """Tell each label by its own distance and evidence alone: a mixture, beta 0."""
    return hmrf_icp.register(source, target, init, rejector=replace(presets.FIELD, beta=0.0))


def without_evidence(source: Any, target: Any, init: Any) -> hmrf_icp.RegistrationResult:
    """Let what the target's sensor saw, or its surface, say nothing of a label."""
    method = presets.ROBUST.method
    assert isinstance(method.match, VisibleMatch)
    bare = replace(presets.ROBUST, method=replace(method, match=method.match.match))
    return hmrf_icp.register(source, target, init, preset=bare)
