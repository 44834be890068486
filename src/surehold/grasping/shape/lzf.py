"""LZF, in which programs of the Point Cloud Library compress clouds; most public scans are.

A control byte c begins each part. Below 32: c + 1 bytes follow that are taken as they are. Else: n = c // 32 bytes (of
7, as many more as the next byte says) and two more are repeated from (c % 32) * 256 + b + 1 bytes before, b the byte
that follows.
"""

import numpy as np
from numpy.typing import NDArray

from surehold.errors import InputError
from surehold.store.kernels import njit

__all__ = ["unpacked"]


def unpacked(data: bytes, size: int) -> bytes:
    """Return the `size` bytes that were compressed; raises InputError if they are not what is found."""
    out = np.empty(size, dtype=np.uint8)
    if _unpack(np.frombuffer(data, dtype=np.uint8), out) != size:
        raise InputError("its compressed data are damaged; copy it again.")
    return out.tobytes()


@njit(cache=True)
def _unpack(data: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Write what was compressed, and return its length, or -1 where the data lead beyond themselves or `out`."""
    i, n = 0, 0
    while i < len(data):
        control = int(data[i])
        i += 1
        if control < 32:
            length = control + 1
            if i + length > len(data) or n + length > len(out):
                return -1
            out[n : n + length] = data[i : i + length]
            i += length
            n += length
            continue
        length = control >> 5
        if length == 7:
            if i >= len(data):
                return -1
            length += int(data[i])
            i += 1
        if i >= len(data):
            return -1
        start = n - ((control & 31) << 8) - int(data[i]) - 1
        i += 1
        length += 2
        if start < 0 or n + length > len(out):
            return -1
        for k in range(length):  # byte by byte: what is repeated may overlap what it makes
            out[n + k] = out[start + k]
        n += length
    return n
