"""What is known of the place that a cloud was seen from, and how."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.cloud import PointCloud
from hmrf_icp.clouds.depth_image import DepthImage, depth_image
from hmrf_icp.clouds.recovered_camera import recovered_camera
from hmrf_icp.clouds.surface import Surface
from hmrf_icp.stages import stage

Array = NDArray[np.float64]
Kind = Literal["given", "recovered", "assumed", "none"]


@dataclass(frozen=True)
class SensorView:
    """How it is known where a cloud was seen from.

    Attributes
    ----------
    kind
        ``"given"`` with the cloud, its camera or its viewpoint; ``"recovered"`` from its points;
        ``"assumed"``, the place from which least is hidden, as for a cloud that was fused from
        several views: which side of its surfaces was seen is not known then; or ``"none"``.
    text
        The same in words, with the numbers.
    at_origin
        Whether an assumed place is the origin of the cloud's frame: the first of several views
        that were fused may have been taken from there.
    sides
        Whether normals that came with the points tell which side of its surfaces was seen.
    """

    kind: Kind
    text: str
    at_origin: bool = False
    sides: bool = False

    def __str__(self) -> str:
        return self.text

    @property
    def known(self) -> bool:
        """Whether the place is known: given or recovered."""
        return self.kind in ("given", "recovered")


NOWHERE = SensorView("none", "none: no viewpoint is known")


@dataclass(frozen=True)
class Seen:
    """A place that a cloud was seen from, in its frame, metres, and the camera if there was one.

    ``image`` holds the observed points of a list as that camera saw them.
    """

    view: SensorView
    place: Array
    camera: PinholeCamera | None = None
    image: DepthImage | None = None


def given_view(cloud: PointCloud) -> SensorView:
    """Say what came with a cloud."""
    if cloud.camera is not None:
        one = cloud.camera
        return SensorView("given", f"given: pinhole {one.width} x {one.height}, fx {one.fx:.1f}")
    if cloud.viewpoint is not None:
        return SensorView("given", f"given: viewpoint at {place_text(cloud.viewpoint)}")
    return NOWHERE


@stage("viewpoint")
def find_view(cloud: PointCloud, surface: Callable[[], Surface], origin: Array) -> Seen:
    """Find where a cloud was seen from that says nothing of it.

    The camera of an organised cloud is recovered exactly, and so is that of a list of the points of
    a depth map. Of other points the origin of their frame is believed where they say so, and
    otherwise the place that hides least is assumed.

    Parameters
    ----------
    cloud
        The points.
    surface
        Fits one to some of them, where a place must be assumed.
    origin
        (3,) of the frame that they were given in, metres.
    """
    from hmrf_icp.clouds.assumed_viewpoint import assumed_viewpoint
    from hmrf_icp.clouds.viewpoint import viewpoint_of

    if cloud.organised:
        seen = _through_a_camera(cloud.points)
        if seen is not None:
            return seen
    if not origin.any():
        points = cloud.observed_points
        image = None if cloud.organised else depth_image(points)
        seen = None if image is None else _through_a_camera(image.points)
        if seen is not None:
            return replace(seen, image=image)
        here = viewpoint_of(points)
        if here.source == "origin":
            return Seen(SensorView("recovered", f"recovered: {here.text}"), here.place)
    place, hidden = assumed_viewpoint(surface(), origin)
    text = f"assumed: {place_text(place)}, {hidden:.1%} hidden from there"
    return Seen(SensorView("assumed", text, np.array_equal(place, origin)), place)


def _through_a_camera(points: Array) -> Seen | None:
    """Recover the camera of points (H, W, 3)."""
    found = recovered_camera(points)
    if found is None:
        return None
    view = SensorView("recovered", found.text)
    return Seen(view, found.viewpoint, found.camera if found.at_origin else None)


def place_text(place: Array) -> str:
    """Write a place (3,) in three digits."""
    return "(" + ", ".join(f"{x:.3g}" for x in place + 0.0) + ")"
