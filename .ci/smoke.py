"""The main public paths once, on the libraries that are installed: what a release must do with the oldest it allows.

    python .ci/smoke.py [optimizer surrogates grasps campaigns studies doors]

Works in a temporary folder, ends with 0 where everything did what it must, and names the first path that did not.
"""

import json
import os
import sys
import tempfile
import urllib.request
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np

import surehold as sh
from surehold.cli import run


def optimizer() -> None:
    box = sh.Box({"a": (0.0, 1.0), "b": (-1.0, 1.0)})
    for settings in ({}, {"surrogate": "tgp"}, {"noise": "inferred"}, {"risk": "cvar"}, {"criterion": "uei"}):
        one = sh.Optimizer(box, input_noise=sh.InputNoise.unit(0.05), n_initial=5, seed=0, **settings)
        for _ in range(7):
            x = one.ask()
            one.tell(x, -float((x**2).sum()))
        assert box.contains(one.recommend().x)
    assert sh.maximize(sh.problems.GM(), sh.problems.GM().box, 8, n_initial=6, seed=0).recommendation.n == 8


def surrogates() -> None:
    points = np.random.default_rng(0).random((20, 2))
    for surrogate in (sh.GaussianProcess(), sh.TreedGaussianProcess()):
        surrogate.fit(points, np.sin(5.0 * points[:, 0]))
        mean, std = surrogate.predict(points, return_std=True)
        assert np.isfinite(mean).all()
        assert np.isfinite(std).all()
    from surehold.sklearn import GaussianProcessRegressor

    assert GaussianProcessRegressor().fit(points, points[:, 0]).score(points, points[:, 0]) > 0.99


def grasps() -> None:
    problem = sh.problems.GraspProblem("mug", variables=("dx", "dy"))
    assert problem.grasp(problem.box.from_unit([0.5, 0.5])).status in sh.grasping.STATUSES
    import trimesh

    trimesh.creation.icosphere(subdivisions=2, radius=0.03).export("ball.stl")
    surehold("grasp ball.stl --unit m --facet right-front --trials 8 --initial 6 --noise 0.03 --check --out ball")
    assert "isaac_grasp" in Path("ball/grasps.yaml").read_text()
    assert "scene-data" in Path("ball/report.html").read_text(encoding="utf-8")


def campaigns() -> None:
    problem = "{function: rkhs, trials: 6, initial: 5, input_noise: 0.05, requeries: 10}"
    plan = f"title: Smoke\nruns: 2\nproblems:\n  hill: {problem}\nmethods:\n  UBO: {{surrogate: gp, robust: true}}\n"
    Path("plan.yaml").write_text(plan)
    for backend in ("loky", "dask"):
        surehold(f"campaign run plan.yaml --workers 2 --backend {backend} --out {backend}")
        assert len(Path(backend, "table.jsonl").read_text().splitlines()) == 3
    surehold("campaign report dask --out pages")
    assert Path("pages/campaigns.html").is_file()


def studies() -> None:
    for storage in ("journal.log", "sqlite:///study.db"):
        surehold(f"study create arm --parameters dx=0:1,fingers=2:5:int --initial 4 --storage {storage}")
        for trial in range(6):
            surehold(f"study ask arm --storage {storage}")
            surehold(f"study tell arm {trial} {0.1 * trial} --storage {storage}")
        surehold(f"study recommend arm --storage {storage}")
    surehold("study report arm --storage journal.log --out arm")
    from surehold.studies import RobotStudy
    from surehold.studies.dashboard import Dashboard
    from surehold.studies.service import listening, service

    token = "0123456789abcdef"
    study = RobotStudy.open("arm", "journal.log")
    assert callable(Dashboard(study, lambda study: {}).application())
    with listening(0) as server:
        Thread(target=server.run, args=(service(study, token),), daemon=True).start()
        request = urllib.request.Request(
            f"{server.address}/studies/arm/status", headers={"Authorization": f"Bearer {token}"}
        )
        with urllib.request.urlopen(request, timeout=30) as answer:
            assert json.load(answer)["state"] == "open"


def doors() -> None:
    from gest_api.vocs import VOCS

    from surehold.gest import RobustGenerator
    from surehold.studies import RobotStudy, SearchSpace, StudySettings
    from surehold.studies.model_context import model_context_server

    generator = RobustGenerator(VOCS(variables={"x": [0.0, 1.0]}, objectives={"f": "MINIMIZE"}), n_initial=3)
    for point in generator.suggest(4):
        generator.ingest([point | {"f": point["x"]}])
    assert generator.recommend().n == 4
    study = RobotStudy.create("door", StudySettings(SearchSpace(sh.Box({"x": (0.0, 1.0)})), None, {}, {}), "door.log")
    assert model_context_server(study).name == "surehold study door"


def surehold(line: str) -> None:
    """Run a command, which must end well."""
    code = run(line.split())
    assert code == 0, f"`surehold {line}` ended with {code}"


def main() -> int:
    """Run all paths, each in a folder of its own."""
    paths: tuple[Callable[[], None], ...] = (optimizer, surrogates, grasps, campaigns, studies, doors)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SUREHOLD_CACHE"] = f"{folder}/cache"
        for path in (path for path in paths if not sys.argv[1:] or path.__name__ in sys.argv):
            place = Path(folder, path.__name__)
            place.mkdir()
            os.chdir(place)
            print(f"--- {path.__name__}", flush=True)
            path()
        os.chdir("/")
    surehold("doctor")
    return 0


if __name__ == "__main__":  # processes of joblib import this file
    sys.exit(main())
