"""What other libraries hold, as arrays: clouds, structured arrays, masks, tensors, cameras."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.camera import PinholeCamera
from hmrf_icp.clouds.distorted_camera import Camera, DistortedCamera
from hmrf_icp.clouds.las_dimensions import las_dimensions
from hmrf_icp.clouds.per_point import beside_points
from hmrf_icp.errors import InputError

COORDINATES = (("x", "y", "z"), ("X", "Y", "Z"), ("f0", "f1", "f2"))
"""Names of the coordinates in structured arrays; the last are those of librealsense."""

ADVICE = (
    "expected a PointCloud, an array (N, 3) or (H, W, 3), or a cloud of Open3D, small_gicp or "
    "another library that has its points"
)


class Parts(NamedTuple):
    """What a cloud of another library holds.

    Attributes
    ----------
    points
        (N, 3) or (H, W, 3) float64, NaN where masked.
    normals, attributes
        As for a :class:`~hmrf_icp.PointCloud`, None and empty where there are none.
    """

    points: NDArray[np.float64]
    normals: Any = None
    attributes: dict[str, Any] = {}  # noqa: RUF012  (never written to)


def parts_of(given: Any) -> Parts:
    """Take points, and what stands beside them, from anything that holds points.

    Raises
    ------
    InputError
        It holds none that can be told; the message says what to pass instead.
    """
    if isinstance(given, np.ndarray):
        return _of_array(given)
    if hasattr(given, "point") and hasattr(given.point, "positions"):  # Open3D's tensor clouds
        return _of_tensors(given)
    if _is_laspy(given):
        # Its .points are whole numbers that wait for a scale; .xyz has metres.
        return Parts(_coordinates(np.asarray(given.xyz)), *las_dimensions(given))
    points = getattr(given, "points", None)
    if callable(points):  # small_gicp's answer a call, with homogeneous points
        points = _called(points, given)
        return Parts(_coordinates(_array(points)), _three(_called(given.normals, given)))
    if points is not None:
        array = _coordinates(_array(points))
        beside = {} if array.ndim != 2 else beside_points(given, len(array))
        return Parts(array, **beside)
    if hasattr(given, "fields") and hasattr(given, "point_step"):
        raise InputError(
            "a PointCloud2 message as it was sent; pass what "
            "sensor_msgs_py.point_cloud2.read_points(message) makes of it"
        )
    named = _by_name(given)
    return _of_array(_array(given)) if named is None else named


def _of_array(array: NDArray[Any]) -> Parts:
    if array.dtype.names is None:
        return Parts(_coordinates(array))
    for names in COORDINATES:
        if set(names) <= set(array.dtype.names):
            break
    else:
        raise InputError(
            f"a structured array with the fields {', '.join(array.dtype.names)}; expected x, y and "
            "z among them"
        )
    points = np.stack([_filled(array[name]) for name in names], axis=-1)
    rest = {
        name: np.ma.getdata(array[name])
        for name in array.dtype.names
        if name not in names and array[name].dtype.kind in "iufb"
    }
    return Parts(points, None, {name: v for name, v in rest.items() if v.ndim <= array.ndim + 1})


def _of_tensors(cloud: Any) -> Parts:
    points = _coordinates(_array(cloud.point.positions))
    held: dict[str, Any] = {name: _array(cloud.point[name]) for name in cloud.point}
    held = {name: values for name, values in held.items() if len(values) == len(points)}
    held.pop("positions", None)
    normals = _three(held.pop("normals", None))
    colours = held.pop("colors", None)
    if colours is not None and colours.ndim == 2:
        stand_in = type("Coloured", (), {"colors": colours})
        held |= beside_points(stand_in, len(points)).get("attributes", {})
    return Parts(points, normals, {name: v for name, v in held.items() if v.dtype.kind in "iufb"})


def _by_name(given: Any) -> Parts | None:
    """Take a table that is asked for its columns: a data frame, a dictionary, plyfile's."""
    if isinstance(given, list | tuple | str | bytes) or not hasattr(given, "__getitem__"):
        return None
    for names in (("vertex",), *COORDINATES[:2]):
        try:
            columns = [given[name] for name in names]
        except (KeyError, IndexError, TypeError, ValueError):
            continue
        if names == ("vertex",):
            return parts_of(columns[0])
        return Parts(np.stack([_filled(_array(column)) for column in columns], axis=-1))
    return None


def _is_laspy(given: Any) -> bool:
    return hasattr(given, "xyz") and hasattr(given, "point_format")


def _called(function: Callable[[], Any], given: Any) -> Any:
    try:
        return function()
    except Exception as error:
        raise InputError(f"{ADVICE}; asking {type(given).__name__} for them: {error}") from None


def _three(vectors: Any) -> Any:
    """Drop the fourth, homogeneous, coordinate of normals; None where they say nothing.

    Memory that was never written to, as small_gicp has it before normals are asked for, does not.
    """
    if vectors is None:
        return None
    array = np.asarray(vectors)
    if array.ndim != 2 or array.shape[1] not in (3, 4) or array.dtype.kind != "f":
        return None
    length = np.linalg.norm(array[:, :3], axis=1)
    unit = np.abs(length - 1.0) < 1e-3
    return (
        array[:, :3] if unit.any() and (unit | (length == 0.0) | np.isnan(length)).all() else None
    )


def _array(given: Any) -> NDArray[Any]:
    """Make an array of a list, a tensor on any device, or anything that NumPy knows."""
    for name in ("detach", "cpu", "numpy"):
        step = getattr(given, name, None)
        if callable(step) and not isinstance(given, np.ndarray):
            given = step()
    try:
        return given if isinstance(given, np.ma.MaskedArray) else np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{ADVICE}; got {type(given).__name__} ({error})") from None


def _filled(array: NDArray[Any]) -> NDArray[np.float64]:
    """Copy numbers as float64 in C's order, NaN where they are masked."""
    if array.dtype.kind not in "iufO":
        raise InputError(f"{ADVICE}; got {_what(array)}")
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # NaN that signals, or too large
            copy = np.array(np.ma.getdata(array), dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InputError(f"{ADVICE}; got {_what(array)} ({error})") from None
    if isinstance(array, np.ma.MaskedArray):
        copy[np.ma.getmaskarray(array)] = np.nan
    return copy


def _coordinates(array: NDArray[Any]) -> NDArray[np.float64]:
    """Return the coordinates (..., 3) of points, also of homogeneous ones."""
    if array.dtype.names is not None:
        return _of_array(array).points
    points = _filled(array)
    if points.ndim == 0:
        raise InputError(f"{ADVICE}; got {_what(array)}")
    columns = points.shape[-1] if points.ndim in (2, 3) else 0
    if columns == 3:
        return points
    if columns == 4 and points.size and (points[..., 3] == 1.0).all():
        return np.ascontiguousarray(points[..., :3])
    found = f"points: expected shape (N, 3) or (H, W, 3), got {points.shape}"
    if columns in range(4, 17):
        raise InputError(
            f"{found}; if the first three columns are x, y and z, pass points[..., :3], and the "
            "others as attributes of a PointCloud"
        )
    if points.ndim == 2 and points.shape[0] == 3:
        raise InputError(f"{found}; pass points.T if the rows are x, y and z")
    if points.ndim == 2:
        raise InputError(f"{found}; if it is a depth map, make it a cloud with from_depth")
    raise InputError(found)


def _what(array: NDArray[Any]) -> str:
    if array.ndim == 0:
        inside = array.item() if array.dtype.kind != "V" else array
        return type(inside).__name__
    return f"an array of {array.dtype}"


def depth_map(given: Any) -> NDArray[Any]:
    """Return one channel (H, W) as an array, in the units and the type that it came in.

    Masked pixels are 0, "nothing seen"; images of other libraries are taken as arrays.

    Raises
    ------
    InputError
        It has more channels, or is no array.
    """
    if hasattr(given, "as_tensor"):  # Open3D's tensor images
        given = given.as_tensor()
    array = _array(given)
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim != 2:
        raise InputError(f"depth: expected one channel of shape (H, W), got {array.shape}")
    if isinstance(array, np.ma.MaskedArray):
        array = np.where(np.ma.getmaskarray(array), array.dtype.type(0), np.ma.getdata(array))
    return array


def as_camera(given: Any, shape: tuple[int, ...]) -> Camera:
    """Take a camera: one, Open3D's PinholeCameraIntrinsic, or a matrix K (3, 3).

    Parameters
    ----------
    given
        The camera.
    shape
        (H, W) of its images, for a matrix, which does not say.

    Raises
    ------
    InputError
        Nothing of the kind.
    """
    return given if isinstance(given, DistortedCamera) else as_pinhole(given, shape)


def as_pinhole(given: Any, shape: tuple[int, ...]) -> PinholeCamera:
    """Take a camera without distortion, as `as_camera` does.

    Raises
    ------
    InputError
        Nothing of the kind.
    """
    if isinstance(given, PinholeCamera):
        return given
    if isinstance(given, DistortedCamera):
        raise InputError(
            "camera: a DistortedCamera, whose pixels are no pinhole's; make the cloud of its depth "
            "map with PointCloud.from_depth"
        )
    matrix = getattr(given, "intrinsic_matrix", None)
    if matrix is not None:
        return PinholeCamera.from_matrix(matrix, int(given.width), int(given.height))
    array = _array(given)
    if array.shape != (3, 3) or array.dtype.kind not in "iuf" or len(shape) != 2:
        raise InputError(
            "camera: expected a PinholeCamera, a matrix K (3, 3) or Open3D's "
            f"PinholeCameraIntrinsic, got {type(given).__name__}"
        )
    return PinholeCamera.from_matrix(array, shape[1], shape[0])
