"""The exponential function for arguments in [-700, 0], in a form that compilers turn into SIMD code (compiled)."""

from typing import Final

import numpy as np

from surehold.store.kernels import njit

__all__ = ["exponential"]

_ROUNDING: Final = 1.5 * 2.0**52  # a double of this size holds whole numbers, in its last bits
_ONE: Final = 1023 << 52  # the bits of 1.0


@njit(cache=True, inline="always")
def exponential(x):
    """Return exp(x) for x in [-700, 0] to 2 units in the last place, in a form that compilers turn into SIMD code.

    exp(x) = 2^k exp(t) with |t| <= ln 2 / 2 (Cody and Waite 1980), exp(t) by its Taylor polynomial of degree 13; a call
    of the C library's exp, one element at a time, takes three times as long. Not to be inlined where sums may be
    reordered (`reassoc`): k is rounded by adding a large number and taking it off again.
    """
    bits = x * 1.4426950408889634 + _ROUNDING
    k = bits - _ROUNDING
    t = (x - k * 0.693145751953125) - k * 1.4286068203094172e-06
    p = 1.6059043836821613e-10
    p = p * t + 2.08767569878681e-09
    p = p * t + 2.505210838544172e-08
    p = p * t + 2.755731922398589e-07
    p = p * t + 2.7557319223985893e-06
    p = p * t + 2.48015873015873e-05
    p = p * t + 0.0001984126984126984
    p = p * t + 0.001388888888888889
    p = p * t + 0.008333333333333333
    p = p * t + 0.041666666666666664
    p = p * t + 0.16666666666666666
    p = p * t + 0.5
    p = p * t + 1.0
    p = p * t + 1.0
    power = (np.float64(bits).view(np.int64) << np.int64(52)) + np.int64(_ONE)
    return p * np.int64(power).view(np.float64)
