"""What an evaluation is asked to do, and what identifies it when it goes on."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from hmrf_icp.errors import InputError
from hmrf_icp.evaluate.protocol import NONE, Start
from hmrf_icp.io.files import existing_file
from hmrf_icp.io.whole import written_whole

DISTRIBUTIONS = (
    "hmrf-icp",
    "numpy",
    "scipy",
    "numba",
    "pykdtree",
    "open3d",
    "small_gicp",
    "fricp-cpp",
    "kiss-matcher",
)
"""Packages whose version may change a result."""


VERSION = "version of "


@dataclass(frozen=True)
class Configuration:
    """An evaluation.

    Parameters
    ----------
    dataset
        What :func:`hmrf_icp.datasets.open_dataset` takes: a folder or a name.
    methods
        The package's own; None means the six of the paper and every other preset, or
        the default alone where the data set lists its pairs.
    peers
        Families (``gicp``) or single settings (``gicp@0.1``); None means every
        one, or those for listed pairs, those that are not installed left out.
    benchmark
        The list to take where the data set has several; empty means all.
    targets
        Indices of the target frames (the paper's reference frame); None means
        two, at a quarter and three quarters of the sequence.
    frames_per_decile
        Source frames from each tenth of overlap, at most.
    starts
        How far from the true pose. None means pi/30, which the paper plots, or
        no start where the data set lists its pairs.
    axes
        Directions of each start.
    subsample
        Step of rows and columns (of points where there is no grid): 1 is all.
    points_alone
        Hand over (N, 3), without camera, viewpoint or grid.
    pairs
        At most so many, spread over scenes and overlap; None means all.
    minimum_overlap
        Pairs below are left out, as are those without any.
    seed
        Of the draws of frames and axes.

    Raises
    ------
    InputError
        A number out of range, or no start.
    """

    dataset: str
    methods: tuple[str, ...] | None = None
    peers: tuple[str, ...] | None = None
    targets: tuple[int, ...] | None = None
    frames_per_decile: int = 5
    starts: tuple[Start, ...] | None = None
    axes: int = 16
    subsample: int = 1
    points_alone: bool = False
    pairs: int | None = None
    benchmark: str = ""
    minimum_overlap: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("frames_per_decile", "axes", "subsample"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}: expected one or more, got {getattr(self, name)}")
        if self.pairs is not None and self.pairs < 1:
            raise InputError(f"pairs: expected one or more, got {self.pairs}")
        if self.seed < 0:
            raise InputError(f"seed: expected zero or more, got {self.seed}")
        if not 0 <= self.minimum_overlap < 1:
            raise InputError(f"minimum_overlap: expected [0, 1), got {self.minimum_overlap:g}")
        if self.starts is None:
            return
        if not self.starts:
            raise InputError("starts: expected one or more")
        if len(set(self.starts)) < len(self.starts):
            raise InputError("starts: one is given twice")

    def resolved(
        self,
        dataset: str,
        methods: Sequence[str],
        peers: Sequence[str],
        targets: Sequence[int],
        starts: Sequence[Start],
    ) -> Configuration:
        """Fill in what was left to the package."""
        return replace(
            self,
            dataset=dataset,
            methods=tuple(methods),
            peers=tuple(peers),
            targets=tuple(targets),
            starts=tuple(starts),
        )


def versions() -> dict[str, str]:
    """Return the versions of what is installed, of all that computes."""
    found = {"python": platform.python_version()}
    for name in DISTRIBUTIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """Describe this machine."""
    return {
        "system": f"{platform.system()} {platform.release()}",
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": _memory_gib(),
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _memory_gib() -> float | None:
    try:
        return round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30, 1)
    except (ValueError, OSError, AttributeError):
        return None


def _identity(configuration: Configuration) -> dict[str, Any]:
    """Return what results depend on; two evaluations that agree here may share a file."""
    flat: dict[str, Any] = json.loads(json.dumps(asdict(configuration)))
    for start, cells in zip(configuration.starts or (), flat["starts"] or (), strict=True):
        if not start.given:  # JSON has no infinity
            cells["angle"] = NONE
    return {**flat, "versions": versions()}


def write(path: Path, configuration: Configuration, about: Mapping[str, Any]) -> None:
    """Write ``config.json``: the configuration, versions, and ``about`` beside them."""
    content = {**_identity(configuration), "machine": machine(), **about}
    with written_whole(path) as partial:
        partial.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def require_same(path: Path, configuration: Configuration) -> None:
    """Refuse to go on with results that another configuration made.

    Raises
    ------
    InputError
        What differs, then and now; or the file is not what `write` wrote.
    """
    try:
        before = json.loads(existing_file(path).read_text(encoding="utf-8"))
        if not isinstance(before, dict):
            raise ValueError("not an object")
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read ({error}); begin anew with --fresh") from None
    was, now = _flat(before), _flat(_identity(configuration))
    changed = [
        f"{name} was {_brief(was.get(name))}, is {_brief(now.get(name))}"
        for name in dict.fromkeys((*now, *was))
        if was.get(name) != now.get(name) and (name in now or name.startswith(VERSION))
    ]
    if changed:
        raise InputError(
            f"{path.parent}: holds an evaluation with another configuration: "
            f"{'; '.join(changed)}. Give another --output, or --fresh to begin anew"
        )


def _flat(content: Mapping[str, Any]) -> dict[str, Any]:
    """Take the versions out of their own object, so that each is compared by itself."""
    found = {name: value for name, value in content.items() if name != "versions"}
    inner = content.get("versions")
    if isinstance(inner, dict):
        found.update({f"{VERSION}{name}": value for name, value in inner.items()})
    return found


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 100 else text[:97] + "..."
