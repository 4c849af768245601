"""Sequences of the TUM RGB-D benchmark by name, fetched from its server."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path, PurePosixPath

from hmrf_icp.datasets.archives import Archive, fetch
from hmrf_icp.datasets.formats import Collection
from hmrf_icp.datasets.sequence import Progress, Sequence
from hmrf_icp.datasets.tum import open_tum
from hmrf_icp.errors import MissingDependencyError

SERVER = "https://cvg.cit.tum.de/rgbd/dataset"

CACHE_VARIABLE = "HMRF_ICP_CACHE"
"""Environment variable for a cache folder other than the system's usual one."""

SEQUENCES = (
    "freiburg1_desk",
    "freiburg1_desk2",
    "freiburg1_floor",
    "freiburg1_room",
    "freiburg2_360_hemisphere",
    "freiburg2_360_kidnap",
    "freiburg2_desk",
    "freiburg2_large_no_loop",
    "freiburg2_large_with_loop",
    "freiburg3_long_office_household",
)
"""Those of the paper and of its follow-up (ICRA 2019)."""

_ALIASES = {"freiburg3_long_household_office": "freiburg3_long_office_household"}
"""The follow-up's result tables turn this name around."""

_PINNED = {
    "freiburg1_desk": (
        "e983d6830916e66dc4a46a71368046b149b283de87769690e7aa4e0b9483530c",
        344_011_403,
    ),
}
"""SHA-256 and bytes of archives whose hash is known."""


def archive(name: str, server: str = SERVER) -> Archive:
    """Return where a sequence's archive is, and what is known about it."""
    folder = f"rgbd_dataset_{name}"
    camera = name.partition("_")[0]
    sha256, size = _PINNED.get(name, (None, None))
    return Archive(f"{server}/{camera}/{folder}.tgz", folder, sha256, size)


def cache_folder() -> Path:
    """Return the folder that downloads are kept in: ``$HMRF_ICP_CACHE``, or the user's cache.

    Raises
    ------
    MissingDependencyError
        Pooch, which knows where a system's users have their cache, is not installed.
    """
    if os.environ.get(CACHE_VARIABLE):
        return Path(os.environ[CACHE_VARIABLE]).expanduser() / "tum"
    try:
        import pooch
    except ImportError:
        raise MissingDependencyError(
            "downloading a data set needs pooch: pip install 'hmrf-icp[evaluate]'"
        ) from None
    return Path(pooch.os_cache("hmrf-icp")) / "tum"


def open_tum_name(member: str, progress: Progress | None = None, server: str = SERVER) -> Sequence:
    """Open ``tum:MEMBER``, fetched first if the cache has not got it.

    Raises
    ------
    DownloadError
        See `hmrf_icp.datasets.archives.fetch`.
    """
    folder = fetch(archive(member, server), cache_folder(), progress, _is_depth)
    return dataclasses.replace(open_tum(folder), name=f"tum:{member}")


def _is_depth(path: PurePosixPath) -> bool:
    """Leave the colour images, most of the bytes and not needed here, in the archive."""
    return path.parts[:1] != ("rgb",)


COLLECTION = Collection("tum", SEQUENCES, open_tum_name, aliases=_ALIASES)
