"""The forms in which recorders write a camera: Open3D, RealSense, Azure Kinect, ROS, OpenCV."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmrf_icp.clouds.distortion import Distortion, Model
from hmrf_icp.errors import InputError
from hmrf_icp.io.files import reading
from hmrf_icp.io.intrinsics import Intrinsics
from hmrf_icp.io.optional import optional

EXPECTED = (
    "expected a 3 x 3 matrix as text, the JSON of an Open3D PinholeCameraIntrinsic "
    "(width, height, intrinsic_matrix), of RealSense intrinsics (fx, fy, ppx, ppy, model, coeffs) "
    "or of an Azure Kinect's calibration (CalibrationInformation), or the YAML of ROS's camera_info"
)

_ROS_MODELS = ("plumb_bob", "rational_polynomial", "none", "")

_REALSENSE_MODELS: dict[str, Model | None] = {
    "none": None,
    "brownconrady": "brown-conrady",
    "modifiedbrownconrady": "modified brown-conrady",
    "inversebrownconrady": "inverse brown-conrady",
}
"""What librealsense calls its models, without what is not a letter."""

_REALSENSE_NUMBERS = ("none", "modifiedbrownconrady", "inversebrownconrady", "ftheta")
"""The same by librealsense's numbers; 4 is Brown-Conrady."""

_KINECT_MODES = (
    ((640, 576), 1024, (192, 180)),
    ((320, 288), 512, (96, 90)),
    ((1024, 1024), 1024, (0, 0)),
    ((512, 512), 512, (0, 0)),
)
"""Images of the Kinect's depth modes, the side of the sensor in their pixels, and where they start.
"""


_MOST_YAML = 1 << 16
"""Characters of a camera in YAML."""


def from_json(path: Path, text: str) -> Intrinsics:
    """Read whichever camera a JSON object holds.

    Raises
    ------
    InputError
        Malformed, or none that is known.
    """
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: malformed JSON ({error}); {EXPECTED}") from None
    if "CalibrationInformation" in content:
        return _read(path, _kinect, content)
    for name in ("depth", "Depth", "depth_intrinsics", "intrinsics"):
        if isinstance(content.get(name), dict) and "fx" in content[name]:
            return _read(path, _realsense, content[name])
    if "ppx" in content or ("fx" in content and "intrinsic_matrix" not in content):
        return _read(path, _realsense, content)
    if "distortion_model" in content and "intrinsic_matrix" not in content:
        return _read(path, _ros, content)
    return _read(path, _open3d, content)


def is_yaml(text: str) -> bool:
    """Whether a text that is neither JSON nor a matrix looks like camera_info."""
    return re.search(r"^\s*(?:camera_matrix|distortion_model|[Kk])\s*:", text, re.M) is not None


def from_yaml(path: Path, text: str) -> Intrinsics:
    """Read ROS's camera_info, as calibration writes it or as a topic shows it, or OpenCV's YAML.

    Raises
    ------
    InputError
        Malformed, none of these, or PyYAML is missing.
    """
    yaml = optional(path, "yaml", "yaml")
    # OpenCV's directive and its tag are not those of YAML.
    plain = re.sub(r"^%YAML:.*$", "", text, flags=re.M).replace("!!opencv-matrix", "").strip()
    if len(plain) > _MOST_YAML or re.search(r"(?:^|[\s\[{,:-])[&*]\w", plain):
        # Aliases of aliases become gigabytes; no recorder writes one.
        raise InputError(f"{path}: a YAML file with anchors, or too long for a camera; {EXPECTED}")
    with reading(path, "a YAML camera"):
        # Not the loader in C: what is nested deep overflows its stack, and nobody can catch that.
        content = next(iter(yaml.load_all(plain, Loader=yaml.SafeLoader)), None)
    if not isinstance(content, dict):
        raise InputError(f"{path}: found {type(content).__name__}; {EXPECTED}")
    return _read(path, _ros, content)


def _read(path: Path, form: Callable[[Path, Any], Intrinsics], content: Any) -> Intrinsics:
    try:
        return form(path, content)
    except InputError as error:
        message = str(error)
        named = message if message.startswith(f"{path}: ") else f"{path}: {message}"
        raise InputError(named) from None
    except KeyError as error:
        raise InputError(f"{path}: it has no {error.args[0]!r}; {EXPECTED}") from None
    except (TypeError, ValueError, AttributeError, OverflowError, IndexError) as error:
        raise InputError(f"{path}: {error}; {EXPECTED}") from None


def _open3d(path: Path, content: Any) -> Intrinsics:
    content = content.get("intrinsic", content)
    # Column by column.
    matrix = np.array(content["intrinsic_matrix"], dtype=np.float64).reshape(3, 3, order="F")
    size = _size(content, "width", "height")
    if matrix[2, :2].any() and not matrix[:2, 2].any():
        raise InputError(
            f"{path}: intrinsic_matrix is written row by row; Open3D writes it column by column: "
            "[fx, 0, 0, 0, fy, 0, cx, cy, 1]"
        )
    return Intrinsics(matrix, str(path), size)


def _realsense(path: Path, content: Any) -> Intrinsics:
    centre = ("ppx", "ppy") if "ppx" in content else ("cx", "cy")
    fx, fy, cx, cy = (_number(content[name]) for name in ("fx", "fy", *centre))
    size = _size(content, "width", "height") if "width" in content else None
    named = next((name for name in ("model", "distortion_model") if name in content), None)
    listed = next((name for name in ("coeffs", "coefficients", "dist") if name in content), None)
    numbers = _numbers(content[listed]) if listed else ()
    model = content[named] if named else ""
    if isinstance(model, int) and not isinstance(model, bool):
        known = (*_REALSENSE_NUMBERS, "brownconrady")
        name = known[model] if model in range(len(known)) else str(model)
    else:
        if not isinstance(model, str):
            raise TypeError(f"model is {type(model).__name__}")
        name = re.sub(r"[^a-z]", "", model.lower().rpartition(".")[2])
        name = name.removeprefix("rsdistortion").removeprefix("distortion")
    distortion = None
    if any(numbers):
        kind = _REALSENSE_MODELS.get(name)
        if kind is None:
            raise InputError(
                f"distortion model {model!r} with coefficients {list(numbers)} is not known; "
                f"expected one of {', '.join(_REALSENSE_MODELS)}, or coefficients of 0"
            )
        distortion = Distortion(kind, numbers)
    return Intrinsics(_matrix(fx, fy, cx, cy), str(path), size, distortion)


def _kinect(path: Path, content: Any) -> Intrinsics:
    """Read the depth camera of an Azure Kinect, whose numbers are shares of its square sensor."""
    cameras = content["CalibrationInformation"]["Cameras"]
    depth = next(
        (
            each
            for each in cameras
            if each.get("Location") == "CALIBRATION_CameraLocationD0"
            or each.get("Purpose") == "CALIBRATION_CameraPurposeDepth"
        ),
        None,
    )
    if depth is None:
        raise InputError(f"none of its {len(cameras)} cameras is the depth camera (D0)")
    model = depth["Intrinsics"]["ModelType"]
    if model != "CALIBRATION_LensDistortionModelBrownConrady":
        raise InputError(
            f"distortion model {model!r}, expected CALIBRATION_LensDistortionModelBrownConrady"
        )
    numbers = _numbers(depth["Intrinsics"]["ModelParameters"])
    if len(numbers) < 14:
        raise InputError(f"{len(numbers)} ModelParameters, expected 14")
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, off_x, off_y, p2, p1 = numbers[:14]
    if off_x or off_y:
        raise InputError(f"a centre of distortion of ({off_x}, {off_y}), expected (0, 0)")
    radius = _number(depth.get("MetricRadius", 0.0))
    distortion = Distortion(
        "brown-conrady", (k1, k2, p1, p2, k3, k4, k5, k6), radius if radius > 0.0 else np.inf
    )
    modes = [
        Intrinsics(
            # Its pixels begin at their corners, ours at their centres.
            _matrix(fx * side, fy * side, cx * side - left - 0.5, cy * side - top - 0.5),
            str(path),
            size,
            distortion,
        )
        for size, side, (left, top) in _KINECT_MODES
    ]
    first = modes[0]
    return Intrinsics(first.matrix, first.name, first.size, distortion, tuple(modes[1:]))


def _ros(path: Path, content: Any) -> Intrinsics:
    size = None
    for names in (("image_width", "image_height"), ("width", "height")):
        if names[0] in content:
            size = _size(content, *names)
    given = next((name for name in ("camera_matrix", "K", "k") if name in content), None)
    if given is None:
        raise KeyError("camera_matrix")
    matrix = np.array(_numbers(content[given])).reshape(3, 3)
    binning = [content.get(name) or 1 for name in ("binning_x", "binning_y")]
    region = content.get("roi") or {}
    if binning != [1, 1] or region.get("x_offset") or region.get("y_offset"):
        raise InputError(
            "camera_info of an image that was binned or cut out; scale and shift the matrix to the "
            "image, and set binning and roi to 0"
        )
    listed = next(
        (n for n in ("distortion_coefficients", "D", "d") if content.get(n) is not None), None
    )
    numbers = _numbers(content[listed]) if listed else ()
    named = content.get("distortion_model") or ""
    model = named if isinstance(named, str) else type(named).__name__
    if not any(numbers):
        return Intrinsics(matrix, str(path), size)
    if model not in _ROS_MODELS or model == "none":
        raise InputError(
            f"distortion_model {model!r} with coefficients {list(numbers)[:8]} is not known; "
            "expected plumb_bob or rational_polynomial, or D of 0 for rectified images"
        )
    return Intrinsics(matrix, str(path), size, Distortion("brown-conrady", numbers))


def _matrix(fx: float, fy: float, cx: float, cy: float) -> NDArray[np.float64]:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        found = repr(value[:40]) if isinstance(value, str) else type(value).__name__
        raise TypeError(f"found {found} where a number should be")
    number = float(value)
    if not np.isfinite(number):
        raise ValueError(f"found {number} where a number should be")
    return number


def _numbers(value: Any) -> tuple[float, ...]:
    """Return the numbers of a list, or of a matrix with its rows and columns."""
    if isinstance(value, Mapping):
        value = value["data"]
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise TypeError(f"found {type(value).__name__} where a list of numbers should be")
    flat = [each for row in value for each in (row if isinstance(row, list) else [row])]
    return tuple(_number(each) for each in flat)


def _size(content: Any, *names: str) -> tuple[int, int]:
    width, height = (content[name] for name in names)
    if type(width) is not int or type(height) is not int:
        raise TypeError("width and height are not whole numbers")
    return width, height
