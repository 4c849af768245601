"""Decompression of LZF, the compression of PCD's ``binary_compressed``.

The one binding on the package index, python-lzf, comes as source alone and
would ask every user for a C compiler. The format is three rules long, and
works on slices here, not on bytes: 300,000 points take about a second.
"""

from __future__ import annotations


def decompress(data: bytes, size: int) -> bytes:
    """Decompress LZF data.

    A control byte below 32 says that 1 + its value literal bytes follow. Any
    other starts a reference to what was written before: its upper three bits
    are the length less two (seven: the next byte is added), its lower five
    bits and the byte after them the distance back, less one.

    Parameters
    ----------
    data
        The compressed bytes.
    size
        How many bytes come out.

    Raises
    ------
    ValueError
        The data is damaged or cut short.
    """
    written = bytearray()
    at, end = 0, len(data)
    try:
        while at < end and len(written) <= size:
            control = data[at]
            at += 1
            if control < 32:
                literal = data[at : at + control + 1]
                if len(literal) <= control:
                    raise IndexError
                written += literal
                at += control + 1
                continue
            length = (control >> 5) + 2
            if length == 9:
                length += data[at]
                at += 1
            distance = ((control & 31) << 8 | data[at]) + 1
            at += 1
            start = len(written) - distance
            if start < 0:
                raise ValueError("the compressed data is damaged")
            # The reference may run into what it writes: then that piece repeats.
            piece = written[start : start + length]
            written += piece if distance >= length else (piece * -(-length // distance))[:length]
    except IndexError:
        raise ValueError("the compressed data is cut short") from None
    if len(written) != size:
        raise ValueError(f"{len(written)} bytes after decompression, {size} promised")
    return bytes(written)
