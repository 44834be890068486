"""What decides an optimizer's kernels, and that a child compiles all of them."""

import os
import subprocess
import sys

import numpy as np
import pytest

import surehold as sh
from surehold.optimization.compilation import essentials
from surehold.store import background

RUN = """
from numba.core import event
class Compiled(event.Listener):
    names = []
    def on_start(self, event): self.names.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event): pass
with event.install_listener("numba:compile", Compiled()):
    import surehold as sh
    optimizer = sh.Optimizer(sh.Box.unit(3), n_initial=8, seed=1, **{settings})
    imported = len(Compiled.names)
    for _ in range(12):
        x = optimizer.ask()
        optimizer.tell(x, float(x[0] - x[1] ** 2))
    optimizer.ask(2)
    optimizer.recommend(where="box")
    optimizer.promise()
print(imported, Compiled.names)
"""


def _compiled_here(settings, folder, **environment):
    return _said_by(RUN.format(settings=settings), folder, **environment)


def _said_by(program, folder, **environment):
    here = {key: value for key, value in os.environ.items() if key != "SUREHOLD_WARM_UP"} | environment
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=here | ({"NUMBA_CACHE_DIR": str(folder)} if folder else {}),
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("settings", ["{}", "{'input_noise': sh.InputNoise.unit(0.1), 'surrogate': 'tgp'}"])
def test_a_child_compiles_everything_that_a_run_needs(settings, tmp_path):
    assert _compiled_here(settings, tmp_path) == "0 []"


NOW = """
import surehold as sh
from surehold.optimization.compilation import compile_now
from surehold.store import background
settings = {settings}
compile_now(settings)
begun = [*background._children, *background._elsewhere]
background._seen.clear()
sh.Optimizer(sh.Box.unit(2), **settings)
print(begun, background._children, background._elsewhere)
"""


@pytest.mark.parametrize("settings", ["{'input_noise': sh.InputNoise.unit(0.1)}", "{'outcome': 'success'}"])
def test_what_is_compiled_now_starts_no_child_neither_then_nor_afterwards(settings, tmp_path):
    assert _said_by(NOW.format(settings=settings), tmp_path) == "[] [] []"


def test_without_a_child_the_run_compiles(tmp_path):
    said = _compiled_here("{}", tmp_path, SUREHOLD_WARM_UP="0")
    assert said.startswith("0 ["), "nothing is compiled at import and construction"
    assert "log_posterior" in said


def test_what_decides_nothing_about_kernels_is_left_out():
    common = {"surrogate": "gp", "kappa": 1.0, "seed": 3}
    assert essentials(common | {"noise": 0.2}) == essentials({"surrogate": "gp", "noise": 3.0, "seed": 4})
    assert essentials(common | {"noise": "inferred"}) != essentials(common | {"noise": 0.2})
    first, second = sh.InputNoise.unit(0.1), sh.InputNoise.uniform({"x": 0.2})
    assert essentials({"input_noise": first}) == essentials({"input_noise": second})
    assert essentials({"input_noise": first}) != essentials({})
    varying = sh.InputNoise.varying(lambda x: 0.1 * x)
    assert essentials({"input_noise": first}) != essentials({"input_noise": varying})


def test_surrogates_from_elsewhere_start_nothing(monkeypatch):
    class Theirs:
        noisy = False

        def condition(self, X, y, rng, previous=None):
            return sh.GaussianProcess().condition(X, y, rng, previous)

    begun = []
    monkeypatch.setattr(background, "begin", lambda *arguments: begun.append(arguments))
    sh.Optimizer(sh.Box.unit(1), surrogate=Theirs())
    assert begun == []
    sh.Optimizer(sh.Box.unit(1), surrogate=sh.GaussianProcess(kernel="matern32"))
    assert len(begun) == 1
    assert np.all([isinstance(part, bytes) for part in begun[0][2:]])
