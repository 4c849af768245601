"""Recordings with known poses, on disk, by name or rendered: what registration is judged on."""

from hmrf_icp.datasets.criterion import Criterion, MatchedRmse, Tolerance
from hmrf_icp.datasets.formats import Collection, Format
from hmrf_icp.datasets.pair_set import ListedPair, PairSet
from hmrf_icp.datasets.progress import progress_bar
from hmrf_icp.datasets.registry import (
    formats,
    names,
    open_dataset,
    open_sequence,
    register_collection,
    register_format,
)
from hmrf_icp.datasets.sequence import DepthMap, Frame, Progress, Scan, Sequence

__all__ = [
    "Collection",
    "Criterion",
    "DepthMap",
    "Format",
    "Frame",
    "ListedPair",
    "MatchedRmse",
    "PairSet",
    "Progress",
    "Scan",
    "Sequence",
    "Tolerance",
    "formats",
    "names",
    "open_dataset",
    "open_sequence",
    "progress_bar",
    "register_collection",
    "register_format",
]
