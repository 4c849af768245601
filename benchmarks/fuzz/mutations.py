"""Ways in which a file goes wrong: in bytes, in words and numbers, in lines, in its structure."""

from __future__ import annotations

import io
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence

NUMBERS = (
    b"0",
    b"-1",
    b"1",
    b"2",
    b"255",
    b"256",
    b"65535",
    b"65536",
    b"2147483648",
    b"4294967296",
    b"99999999999999999999",
    b"1e400",
    b"-1e308",
    b"1e-320",
    b"nan",
    b"inf",
    b"-nan(ind)",
    b"1.#QNAN",
    b"0x10",
    b"1_0",
    b"\xc2\xb2",
    b"--5",
    b"1" * 400,
    b"9" * 5000,
)
WORDS = (
    b"",
    b"x",
    b"nan",
    b"list",
    b"float",
    b"uchar",
    b"double",
    b"ascii",
    b"binary_little_endian",
    b"binary_compressed",
    b"F",
    b"U",
    b"I",
    b"null",
    b"true",
    b"{}",
    b"[]",
    b"#",
    b"//",
    b";",
    b",",
    b'"',
    b"'",
    b"\0",
    b"\xff\xfe",
    b"\xed\xb3\xbf",
    b"\xe2\x80\xa8",
    b"\x85",
    b"\r",
    b"points",
    b"camera",
    b"normals",
    b"viewpoint",
    b"a" * 300,
    b"../../etc/passwd",
    b"[" * 2000,
)
BOUNDS = (0, 1, 2, 127, 128, 255, 256, 32767, 65535, 1 << 24, (1 << 31) - 1, 1 << 31, (1 << 32) - 1)

Mutation = Callable[[random.Random, bytes, Sequence[bytes]], bytes]


def mutated(rng: random.Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """Return ``data`` with one to five things wrong with it; the same for the same generator.

    Parameters
    ----------
    others
        Valid files of all kinds, pieces of which may get in.
    """
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5))):
        data = rng.choice(MUTATIONS)(rng, data, others)
    return data


def restructured(rng: random.Random, suffix: str, data: bytes, others: Sequence[bytes]) -> bytes:
    """Mutate what is inside a file with checksums, and let those be right."""
    if suffix == ".npz":
        return _archive(rng, data, others)
    if suffix == ".png":
        if rng.random() < 0.5:
            return _with_checksums(mutated(rng, data, others))
        return _repacked_image(rng, data, others)
    if suffix == ".e57":
        return _with_pages(mutated(rng, _without_pages(data), others))
    if suffix == ".glb":
        return _with_lengths(mutated(rng, data[20:], others), data)
    return mutated(rng, data, others)


def _piece(rng: random.Random, data: bytes) -> tuple[int, int]:
    at = rng.randrange(len(data) + 1)
    return at, min(len(data), at + rng.choice((1, 1, 2, 4, 8, 16, 64)))


def _byte(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at, end = _piece(rng, data)
    return data[:at] + rng.randbytes(end - at) + data[end:]


def _early_byte(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at = rng.randrange(min(len(data), 200) + 1)
    return data[:at] + rng.randbytes(1) + data[at + 1 :]


def _bit(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _bound(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    size = rng.choice((1, 2, 4, 8))
    at = rng.randrange(len(data) + 1)
    code = rng.choice("<>") + {1: "B", 2: "H", 4: "I", 8: "Q"}[size]
    value = rng.choice(BOUNDS) % (1 << 8 * size)
    return data[:at] + struct.pack(code, value) + data[at + size :]


def _cut(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _lost(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at, end = _piece(rng, data)
    return data[:at] + data[end:]


def _again(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at, end = _piece(rng, data)
    times = rng.choice((1, 1, 2, 10, 500))
    return data[:end] + data[at:end] * times + data[end:]


def _foreign(rng: random.Random, data: bytes, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others)
    at, (start, end) = rng.randrange(len(data) + 1), _piece(rng, other)
    return data[:at] + other[start:end] + data[at:]


def _number(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    found = list(re.finditer(rb"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?", data[:4000]))
    if not found:
        return data
    match = rng.choice(found)
    return data[: match.start()] + rng.choice(NUMBERS) + data[match.end() :]


def _word(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    found = list(re.finditer(rb"[A-Za-z_][\w.]*|[^\s\w]", data[:2000]))
    if not found:
        return data
    match = rng.choice(found)
    new = rng.choice(WORDS) if rng.random() < 0.6 else rng.choice(found).group()
    return data[: match.start()] + new + data[match.end() :]


def _line(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    lines = data.split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            lines[at], lines[other] = lines[other], lines[at]
        case 1:
            del lines[at]
        case 2:
            lines.insert(at, lines[other])
        case 3:
            lines[at:at] = [lines[other]] * rng.choice((3, 300))
        case _:
            words = lines[at].split()
            rng.shuffle(words)
            lines[at] = b" ".join(words)
    return b"\n".join(lines)


def _ends(rng: random.Random, data: bytes, _: Sequence[bytes]) -> bytes:
    return data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b"\n \n", b" ")))


MUTATIONS: tuple[Mutation, ...] = (
    _byte,
    _early_byte,
    _bit,
    _bound,
    _cut,
    _lost,
    _again,
    _foreign,
    _number,
    _number,
    _word,
    _word,
    _line,
    _ends,
)


def _without_pages(data: bytes) -> bytes:
    """Take the checksums out of an E57 file."""
    return b"".join(data[at : at + 1020] for at in range(0, len(data), 1024))


def _with_pages(data: bytes) -> bytes:
    """Put the right checksums into an E57 file, and the right length in front."""
    data += bytes(-len(data) % 1020)
    pages = [data[at : at + 1020] for at in range(0, len(data), 1020)]
    if pages:
        length = struct.pack("<Q", 1024 * len(pages))
        pages[0] = pages[0][:16] + length + pages[0][24:]
    return b"".join(page + struct.pack(">I", _crc32c(page)) for page in pages)


def _crc32c(data: bytes) -> int:
    """Castagnoli's checksum, which no library of Python's own has."""
    value = 0xFFFFFFFF
    for byte in data:
        value = _CRC[(value ^ byte) & 0xFF] ^ value >> 8
    return value ^ 0xFFFFFFFF


def _crc_table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (0x82F63B78 if value & 1 else 0)
        table.append(value)
    return table


_CRC = _crc_table()


def _with_lengths(content: bytes, whole: bytes) -> bytes:
    """Put the lengths that it has in front of a mutated GLB, which is split where it was."""
    (described,) = struct.unpack_from("<I", whole, 12)
    start = content.find(b"BIN\0") - 4
    if start > 0:
        described = start
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(content), described, b"JSON")
    return head + content


def _archive(rng: random.Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """Mutate one member of a zip file, or its name, and pack all of them again."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    at = rng.randrange(len(members))
    name, content = members[at]
    if rng.random() < 0.2:
        name = rng.choice(WORDS).decode("latin-1").replace("\0", "") + ".npy"
    members[at] = (name or "points.npy", mutated(rng, content, others))
    if rng.random() < 0.1:
        members.append(rng.choice(members))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", rng.choice((0, zipfile.ZIP_DEFLATED))) as archive:
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content)
    return stream.getvalue()


def _repacked_image(rng: random.Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """Mutate the header or the pixels of a PNG, and pack them as they should be."""
    header, pixels = data[16:29], b""
    at = 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        if data[at + 4 : at + 8] == b"IDAT":
            pixels += data[at + 8 : at + 8 + length]
        at += 12 + length
    pixels = zlib.decompress(pixels)
    if rng.random() < 0.5:
        header = _bound(rng, header, others)[:13].ljust(13, b"\0")
    if rng.random() < 0.5:
        pixels = mutated(rng, pixels, others)
    result = data[:8]
    for kind, content in ((b"IHDR", header), (b"IDAT", zlib.compress(pixels)), (b"IEND", b"")):
        chunk = kind + content
        result += struct.pack(">I", len(content)) + chunk + struct.pack(">I", zlib.crc32(chunk))
    return result


def _with_checksums(data: bytes) -> bytes:
    """Put the right checksum behind every chunk of a PNG that still has a length."""
    result, at = data[:8], 8
    while at + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, at)
        if at + 12 + length > len(data):
            break
        chunk = data[at + 4 : at + 8 + length]
        result += data[at : at + 4] + chunk + struct.pack(">I", zlib.crc32(chunk))
        at += 12 + length
    return result + data[at:]
