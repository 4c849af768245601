"""Small valid files of every format that is read, and small recordings of every layout."""

from __future__ import annotations

import io
import json
import struct
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image

from hmrf_icp import PinholeCamera, PointCloud, se3
from hmrf_icp.io import write_cloud

_NEEDED = {".las": "laspy", ".laz": "lazrs", ".e57": "pye57"}
"""Libraries without which these are left out."""

RNG = np.random.default_rng(5)
WIDTH, HEIGHT = 8, 6
CAMERA = PinholeCamera(WIDTH, HEIGHT, 8.0, 8.0, 3.5, 2.5)
DEPTH = RNG.integers(500, 4000, (HEIGHT, WIDTH)).astype(np.uint16)
POINTS = RNG.normal(size=(12, 3)).round(3)
POSES = [se3.exp(0.1 * RNG.normal(size=6)) for _ in range(3)]

_ATTRIBUTES = {
    "red": RNG.integers(0, 256, 12, np.uint8),
    "green": RNG.integers(0, 256, 12, np.uint8),
    "blue": RNG.integers(0, 256, 12, np.uint8),
    "intensity": RNG.random(12, np.float32),
    "ring": np.arange(12, dtype=np.uint16),
}
CLOUD = PointCloud(
    POINTS, viewpoint=np.array([9.0, 9.0, 9.0]), normals=POINTS, attributes=_ATTRIBUTES
)
GRID = PointCloud(RNG.normal(size=(HEIGHT, WIDTH, 3)), CAMERA)

PLY_LISTS = (
    "ply\nformat ascii 1.0\ncomment made\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty list uchar int tags\nelement face 2\n"
    "property list uchar int vertex_indices\nend_header\n"
    "0 0 1 0\n1 0 1 2 5 6\n0 1 1 1 7\n1 1 2 0\n3 0 1 2\n4 0 1 2 3\n"
)
PLY_GRID = (
    "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\nelement vertex 3\n"
    "property float x\nproperty float y\nproperty float z\nproperty float confidence\n"
    "element range_grid 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 1 0.5\n1 0 1 0.25\n0 1 1 1\n1 0\n0\n1 1\n1 2\n"
)
PCD_TEXT = (
    "# .PCD v.7\nVERSION .7\nFIELDS x y z normal_x normal_y normal_z rgb label _\n"
    "SIZE 4 4 4 4 4 4 4 2 1\nTYPE F F F F F F F U U\nCOUNT 1 1 1 1 1 1 1 1 2\nWIDTH 2\nHEIGHT 2\n"
    "VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 4\nDATA ascii\n"
    + "".join(f"{i} {i / 2} 1 0 0 1 2.3e-38 {i} 0 0\n" for i in range(3))
    + "nan nan nan nan nan nan 0 0 0 0\n"
)


def files() -> dict[str, tuple[str, bytes]]:
    """Suffix and content of a file by the name of its kind."""
    found: dict[str, tuple[str, bytes]] = {
        "png": (".png", _image(DEPTH, "PNG")),
        "tiff": (".tif", _image(DEPTH, "TIFF")),
        "tiff-float": (".tif", _image(DEPTH.astype(np.float32), "TIFF")),
        "tiff-packed": (".tiff", _image(DEPTH, "TIFF", compression="tiff_lzw")),
        "pgm": (".pgm", b"P5\n# made\n8 6\n4095\n" + DEPTH.astype(">u2").tobytes()),
        "pgm-plain": (".pgm", b"P2 8 6 4095\n" + " ".join(map(str, DEPTH.ravel())).encode()),
        "npy-depth": (".npy", _saved(DEPTH)),
        "npy-points": (".npy", _saved(np.asfortranarray(POINTS))),
        "ply-lists": (".ply", PLY_LISTS.encode()),
        "ply-lists-binary": (".ply", _binary_lists()),
        "ply-grid": (".ply", PLY_GRID.encode()),
        "pcd-text": (".pcd", PCD_TEXT.encode()),
        "pcd-packed": (".pcd", _packed_pcd()),
        "xyz": (".xyz", "".join(f"{x} {y} {z}\n" for x, y, z in POINTS).encode()),
        "csv-odd": (
            ".csv",
            b'\xef\xbb\xbfid;"X [m]";Y [m];Z [m];name\n1;0.5;1e-3;-2;a\n'
            b'2;1;-nan(ind);1.#INF;"b;c"\n',
        ),
        "pose": ("pose", _matrix(POSES[0])),
        "camera": ("camera", _matrix(CAMERA.matrix)),
        "camera-json": ("camera", json.dumps(camera_json()).encode()),
    }
    found |= cameras()
    found |= meshes()
    with tempfile.TemporaryDirectory() as folder:
        found |= images(Path(folder))
        for name, suffix, cloud in (
            ("las", ".las", CLOUD),
            ("laz", ".laz", CLOUD),
            ("e57", ".e57", CLOUD),
            ("obj-points", ".obj", CLOUD),
            ("pts", ".pts", CLOUD),
            ("ply", ".ply", CLOUD),
            ("pcd", ".pcd", CLOUD),
            ("pcd-grid", ".pcd", GRID),
            ("csv", ".csv", CLOUD),
            ("xyzn", ".xyzn", CLOUD),
            ("npz", ".npz", CLOUD),
            ("npz-grid", ".npz", GRID),
        ):
            path = Path(folder) / f"c{suffix}"
            if _NEEDED.get(suffix) and not find_spec(_NEEDED[suffix]):
                continue
            write_cloud(path, cloud)
            found[name] = (suffix, path.read_bytes())
    return found


def cameras() -> dict[str, tuple[str, bytes]]:
    """Cameras as recorders write them, by the name of their kind."""
    numbers = [0.1, -0.2, 0.001, 0.002, 0.05]
    realsense = {"width": 8, "height": 6, "ppx": 3.5, "ppy": 2.5, "fx": 8.0, "fy": 8.0}
    realsense |= {"model": "distortion.inverse_brown_conrady", "coeffs": numbers}
    depth = {
        "Intrinsics": {
            "ModelParameters": [0.5, 0.5, 0.5, 0.5, *numbers, 0.1, 0, 0, 1e-4, 1e-4],
            "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
        },
        "Location": "CALIBRATION_CameraLocationD0",
        "MetricRadius": 1.74,
    }
    ros = (
        "image_width: 8\nimage_height: 6\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
        "  data: [8.0, 0.0, 3.5, 0.0, 8.0, 2.5, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: {numbers}\nroi: {{x_offset: 0}}\n"
    )
    kinect = {"CalibrationInformation": {"Cameras": [depth]}}
    found = {
        "camera-realsense": ("camera", json.dumps(realsense).encode()),
        "camera-kinect": ("camera", json.dumps(kinect).encode()),
    }
    return found | ({"camera-ros": ("camera", ros.encode())} if find_spec("yaml") else {})


def meshes() -> dict[str, tuple[str, bytes]]:
    """Tetrahedra in every format of meshes."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    obj = "".join(f"v {x} {y} {z} 1 0.5 0\n" for x, y, z in corners)
    obj += "vn 0 0 1\nvt 0 0\n" + "".join(f"f {a}//1 {b}//1 {c}//1\n" for a, b, c in faces + 1)
    text = "solid made\n"
    for face in faces:
        text += "facet normal 0 0 0\nouter loop\n"
        text += "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners[face])
        text += "endloop\nendfacet\n"
    binary = bytes(80) + struct.pack("<I", 4)
    for face in faces:
        binary += struct.pack("<12fH", 0, 0, 0, *corners[face].ravel(), 0)
    ply = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nelement face 4\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    ply += "".join(f"{x} {y} {z} 7\n" for x, y, z in corners)
    ply += "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)
    drawn = {
        "obj": (".obj", obj.encode()),
        "stl-text": (".stl", (text + "endsolid made\n").encode()),
        "stl": (".stl", binary),
        "glb": (".glb", _glb(corners, faces)),
    }
    return (drawn if find_spec("trimesh") else {}) | {
        "ply-mesh": (".ply", ply.encode()),
        "bin": (".bin", np.c_[POINTS, POINTS[:, 0]].astype("<f4").tobytes()),
        "asc": (
            ".asc",
            b"//X Y Z R G B Nx Ny Nz\n" + b"".join(_line([*p, 1, 2, 3, *p]) for p in POINTS),
        ),
    }


def images(folder: Path) -> dict[str, tuple[str, bytes]]:
    """Depth maps in EXR, in two of its ways to pack them."""
    if not find_spec("OpenEXR"):
        return {}
    import OpenEXR

    found = {}
    for name, packed, channels in (
        ("exr", OpenEXR.ZIP_COMPRESSION, {"Z": DEPTH.astype(np.float32)}),
        ("exr-piz", OpenEXR.PIZ_COMPRESSION, {"Z": DEPTH.astype(np.float16), "A": DEPTH * 1.0}),
        ("exr-plain", OpenEXR.NO_COMPRESSION, {"depth.V": DEPTH.astype(np.float32)}),
    ):
        header = {"compression": packed, "type": OpenEXR.scanlineimage}
        channels = {n: v.astype(np.float32) if v.itemsize > 4 else v for n, v in channels.items()}
        with OpenEXR.File(header, channels) as file:
            file.write(str(folder / "d.exr"))
        found[name] = (".exr", (folder / "d.exr").read_bytes())
    return found


def _glb(corners: np.ndarray, faces: np.ndarray) -> bytes:
    blob = corners.astype("<f4").tobytes() + faces.astype("<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1]}, {"mesh": 0, "scale": [1, 2, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0")
    return b"glTF" + struct.pack("<II", 2, 12 + len(body) + len(blob)) + body + blob


def camera_json() -> dict[str, object]:
    """Return the camera as Open3D writes it."""
    matrix = CAMERA.matrix.T.ravel().tolist()
    return {"width": WIDTH, "height": HEIGHT, "intrinsic_matrix": matrix}


def recordings() -> dict[str, dict[str, bytes]]:
    """Content of the files of a recording by the name of its layout."""
    from scipy.spatial.transform import Rotation

    png, k = _image(DEPTH, "PNG"), _matrix(CAMERA.matrix)
    pgm = b"P5\n8 6\n65535\n" + DEPTH.astype(">u2").tobytes()
    quaternions = [Rotation.from_matrix(pose[:3, :3]).as_quat() for pose in POSES]
    seven = {"camera-intrinsics.txt": k}
    redwood = {"camera_intrinsic.json": json.dumps(camera_json()).encode()}
    infinitam = {
        "calib.txt": b"8 6\n8 8\n3.5 2.5\n\n8 6\n8 8\n3.5 2.5\n\n1 0 0 0\n0 1 0 0\n0 0 1 0\n\n"
        b"affine 0.001 0.0\n",
        "poses.txt": b"".join(_line(pose.ravel()) for pose in POSES),
    }
    kitti = {
        "calib.txt": b"P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n",
        "times.txt": b"0.0\n0.1\n0.2\n",
        "poses.txt": b"".join(_line(pose[:3].ravel()) for pose in POSES),
    }
    clouds = {
        "poses.txt": b"".join(
            _line([*q, *pose[:3, 3]]) for q, pose in zip(quaternions, POSES, strict=True)
        )
    }
    tum: dict[str, bytes] = {"camera-intrinsics.txt": k}
    listed, log = [], b""
    for i, pose in enumerate(POSES):
        seven[f"frame-{i:06d}.depth.png"], seven[f"frame-{i:06d}.pose.txt"] = png, _matrix(pose)
        redwood[f"depth/{i:05d}.png"] = png
        log += f"{i} {i} {i + 1}\n".encode() + _matrix(pose)
        infinitam[f"Frames/{i:04d}.pgm"] = pgm
        kitti[f"velodyne/{i:06d}.bin"] = np.c_[POINTS, POINTS[:, 0]].astype("<f4").tobytes()
        clouds[f"scan_{i}.pcd"] = PCD_TEXT.encode()
        tum[f"depth/{i}.png"] = png
        listed.append(f"{i}.05 depth/{i}.png\n")
    redwood["trajectory.log"] = log
    tum["depth.txt"] = ("# made\n" + "".join(listed)).encode()
    times = np.arange(0.0, 2.2, 0.01)
    numbers = (*POSES[0][:3, 3], *quaternions[0])
    tum["groundtruth.txt"] = b"".join(_line([t, *numbers]) for t in times)
    return {
        "7-Scenes": seven,
        "Open3D": redwood,
        "InfiniTAM": infinitam,
        "KITTI": kitti,
        "clouds": clouds,
        "TUM": tum,
    }


def _image(values: np.ndarray, kind: str, **options: str) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(values).save(stream, kind, **options)
    return stream.getvalue()


def _saved(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def _line(numbers: object) -> bytes:
    return (" ".join(f"{n:.9g}" for n in np.asarray(numbers)) + "\n").encode()


def _matrix(matrix: np.ndarray) -> bytes:
    return b"".join(_line(row) for row in matrix)


def _binary_lists() -> bytes:
    header = PLY_LISTS.partition("end_header\n")[0].replace("ascii", "binary_big_endian")
    body = b""
    for x, y, z, tags in ((0, 0, 1, ()), (1, 0, 1, (5, 6)), (0, 1, 1, (7,)), (1, 1, 2, ())):
        body += struct.pack(f">fffB{len(tags)}i", x, y, z, len(tags), *tags)
    for face in ((0, 1, 2), (0, 1, 2, 3)):
        body += struct.pack(f">B{len(face)}i", len(face), *face)
    return header.encode() + b"end_header\n" + body


def _packed_pcd() -> bytes:
    header = PCD_TEXT.partition("DATA")[0].replace("label _", "label").replace(" U U", " U")
    header = header.replace(" 2 1\n", " 2\n").replace(" 1 2\n", " 1\n")
    fields = np.arange(28, dtype="<f4").tobytes() + np.arange(4, dtype="<u2").tobytes()
    runs = [fields[at : at + 32] for at in range(0, len(fields), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    sizes = struct.pack("<II", len(packed), len(fields))
    return header.encode() + b"DATA binary_compressed\n" + sizes + packed
