"""What was learnt from trials, kept for the next asks: saves time, changes no result."""

from collections import OrderedDict
from collections.abc import Callable
from hashlib import sha256
from typing import Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from surehold.defaults import RELEARNT_DIVISOR

__all__ = ["Remembered", "fingerprint", "learnt_from"]

Value = TypeVar("Value")

_FEW: Final = 4  # sets of trials: those of an ask, of a surprise, and of the last asks before


class Remembered(Generic[Value]):
    """Values by the fingerprint of what they follow from; of more than `most` the one not used for longest is dropped.

    A value must follow from its fingerprint alone, random numbers included.
    """

    def __init__(self, most: int = _FEW):
        self._most = most
        self._values: OrderedDict[bytes, Value] = OrderedDict()

    def value(self, key: bytes, make: Callable[[], Value]) -> Value:
        """Return the value of a fingerprint, made if it is not there."""
        if key not in self._values:
            self._values[key] = make()
            if len(self._values) > self._most:
                self._values.popitem(last=False)
        self._values.move_to_end(key)
        return self._values[key]

    def clear(self) -> None:
        """Forget all values."""
        self._values.clear()


def learnt_from(n: int) -> int:
    """Return k: of n trials, the first k are those that hyperparameters are learnt from; n - n/16 < k <= n."""
    return n - n % (1 << max(0, n.bit_length() - RELEARNT_DIVISOR.bit_length()))


def fingerprint(X: NDArray[np.float64], y: NDArray[np.float64], noise: NDArray[np.float64] | None, *others) -> bytes:
    """Return a digest of trials and of other settings that have a faithful `repr`."""
    content = sha256(repr((X.shape, noise is None, others)).encode())
    for array in (X, y) if noise is None else (X, y, noise):
        content.update(np.ascontiguousarray(array).tobytes())
    return content.digest()
