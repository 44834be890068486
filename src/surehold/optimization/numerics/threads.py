"""One BLAS thread inside a process; parallelism is across trials and runs.

The matrices here are small: a second thread costs more in waking than it saves, and many workers on one machine would
fight for cores.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

from surehold.store.uninterrupted import uninterrupted

__all__ = ["computing", "single_threaded"]


@cache
def _controller() -> ThreadpoolController:
    import scipy.linalg.cython_blas  # noqa: F401  # whose library the compiled functions use, loaded by now or not

    return ThreadpoolController()  # scans the loaded libraries, once


@contextmanager
def single_threaded() -> Iterator[None]:
    """Limit linear algebra to one thread inside a `with` block."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@contextmanager
def computing() -> Iterator[None]:
    """Do as `single_threaded`; Ctrl-C waits for the end of the block. For what runs no code of the user."""
    with uninterrupted(), single_threaded():
        yield
