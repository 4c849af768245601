"""The examples in the docstrings run, and print what they say."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import hmrf_icp

MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(hmrf_icp.__path__, "hmrf_icp.")
    if not module.name.startswith(("hmrf_icp.cli", "hmrf_icp.kernels", "hmrf_icp.__main__"))
)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name):
    outcome = doctest.testmod(importlib.import_module(name))
    assert outcome.failed == 0


def test_the_front_of_the_package_is_its_interface_and_nothing_else():
    assert set(dir(hmrf_icp)) == {*hmrf_icp.__all__, "__version__"}
    assert all(getattr(hmrf_icp, name).__doc__ for name in hmrf_icp.__all__)
