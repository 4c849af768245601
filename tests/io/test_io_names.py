"""Attributes of any name can be written, and what was written can be read."""

from __future__ import annotations

import numpy as np
import pytest

from hmrf_icp import PointCloud, read_cloud, write_cloud

NAMES = ("points", "time:offset", ":", "1", "nan", "", "\n", "end_header", "a,b", "\ud800", "=1+1")
NAMES += ("with space", "é", "x" * 60, "a=b", "a\\b")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("suffix", [".las", ".ply", ".pcd", ".e57", ".csv", ".npz", ".xyz"])
def test_an_attribute_of_any_name_is_no_reason_to_fail(tmp_path, suffix, name):
    if suffix in (".las", ".e57"):
        pytest.importorskip({".las": "laspy", ".e57": "pye57"}[suffix])
    points, values = np.random.default_rng(0).normal(size=(12, 3)), np.arange(12.0)
    write_cloud(tmp_path / f"c{suffix}", PointCloud(points, attributes={name: values}))
    read = read_cloud(tmp_path / f"c{suffix}")
    np.testing.assert_allclose(read.observed_points, points, atol=1e-6)
    if suffix not in (".xyz", ".e57"):  # which have no room for names of one's own
        assert any(np.array_equal(found, values) for found in read.attributes.values())
