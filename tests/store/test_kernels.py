"""numba's cache where it can be written, where it cannot, and on a full disk; each in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from surehold.store import kernels

KERNELS = """
from surehold.store.kernels import njit

@njit(cache=True)
def lazily(x):
    return x + 1.0

@njit("float64(float64)", cache=True)
def at_once(x):
    return 2.0 * x

@njit(cache=True, fastmath={"contract"})
def more(x):
    return at_once(lazily(x))
"""

FULL_DISK = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
"""


@pytest.fixture
def place(tmp_path):
    """A folder with a module of kernels, and an account whose home and temporary folder lie in it."""
    (tmp_path / "module").mkdir()
    (tmp_path / "module" / "kernels.py").write_text(KERNELS)
    (tmp_path / "temporary").mkdir()
    return tmp_path


def _answer(place, before=""):
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment |= {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null/none", "TMPDIR": str(place / "temporary")}
    code = (
        f"import sys\nsys.path.insert(0, {str(place / 'module')!r})\n{before}\nimport kernels\nprint(kernels.more(3.0))"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", code], env=environment, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.stdout == "8.0\n", done.stderr
    return done.stderr


def _kept(folder):
    return {path.name.split("-")[0] for path in folder.rglob("*.nbi")}


ALL = {"kernels.lazily", "kernels.at_once", "kernels.more"}


def test_beside_the_source(place):
    assert _answer(place) == ""
    assert _kept(place / "module" / "__pycache__") == ALL


def test_without_a_folder_a_private_temporary_one_serves(place):
    (place / "module" / "__pycache__").write_text("a file, so that no folder can be made here")
    assert _answer(place) == ""
    (folder,) = (place / "temporary").iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert _kept(folder) == ALL
    assert _answer(place) == "", "a second process"
    assert list((place / "temporary").iterdir()) == [folder], "it uses the same folder"


def test_a_temporary_folder_that_others_may_write_is_not_used(place):
    (place / "module" / "__pycache__").write_text("")
    taken = place / "temporary" / f"surehold-kernels-{os.getuid()}"
    taken.mkdir()
    taken.chmod(0o777)
    assert _answer(place) == ""
    assert list(taken.iterdir()) == []
    assert _kept(place / "temporary") == ALL


def test_without_any_folder_it_runs_and_says_so_once(place):
    (place / "module" / "__pycache__").write_text("")
    (place / "temporary" / f"surehold-kernels-{os.getuid()}").write_text("")
    said = _answer(place)
    assert said.startswith("compiled kernels cannot be kept (File exists)")
    assert said.count("\n") == 1


def test_on_a_full_disk_it_runs_and_says_so_once(place):
    said = _answer(place, FULL_DISK)
    assert said.startswith("compiled kernels cannot be kept (File too large)")
    assert said.count("\n") == 1


def test_a_kernel_is_compiled_anew_where_one_that_it_calls_has_changed(tmp_path):
    """Numba itself would go on with the machine code of before."""
    package = tmp_path / "surehold" / "store"
    package.mkdir(parents=True)
    source = Path(kernels.__file__).read_text(encoding="utf-8")
    for folder in (package.parent, package):
        (folder / "__init__.py").write_text("")
    (package / "kernels.py").write_text(source)
    (package.parent / "outer.py").write_text(
        "from surehold.store.kernels import njit\nfrom surehold.inner import inner\n"
        "@njit(cache=True)\ndef outer(x):\n    return 10 * inner(x)\nprint(outer(1))\n"
    )
    found = []
    for number in (1, 1, 2):
        (package.parent / "inner.py").write_text(
            f"from surehold.store.kernels import njit\n@njit(cache=True)\ndef inner(x):\n    return x + {number}\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", "import surehold.outer"],
            env=os.environ
            | {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=True,
            cwd=tmp_path,
        )
        found.append(int(done.stdout))
    assert found == [20, 20, 30]


def test_a_kernel_is_compiled_once_whether_or_not_an_argument_is_a_constant():
    @kernels.njit(cache=False)
    def times(x, n):
        return x * n

    @kernels.njit(cache=False)
    def five_times(x, n):
        return times(x, 2) + times(n=n, x=x)

    assert five_times(7.0, 3) == 35.0
    assert len(times.signatures) == 1
