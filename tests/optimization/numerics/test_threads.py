import subprocess
import sys

CODE = """
from surehold.optimization.numerics.threads import single_threaded
with single_threaded():
    import numpy, scipy.linalg
    from threadpoolctl import threadpool_info
    print([pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"])
"""


def test_libraries_that_are_loaded_later_are_limited_too():
    """The compiled functions use SciPy's own library, which nothing may have loaded yet."""
    said = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True).stdout
    assert set(eval(said)) == {1}
