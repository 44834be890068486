"""The package folder for OptunaHub, loaded by OptunaHub itself and run in Optuna's own loop."""

from pathlib import Path

import optuna
import pytest
import yaml

import surehold as sh

HUB = Path(__file__).parents[2] / "examples/optunahub/package"
optunahub = pytest.importorskip("optunahub")


def test_the_front_matter_is_what_the_hub_asks_for():
    front = yaml.safe_load((HUB / "samplers/surehold/README.md").read_text(encoding="utf-8").split("---")[1])
    assert {"author", "title", "description", "tags", "optuna_versions", "license"} <= front.keys()
    assert "sampler" in front["tags"]
    assert (HUB / "samplers/surehold/LICENSE").read_text().startswith(front["license"])


def test_the_loop_of_optuna_ends_with_what_holds():
    module = optunahub.load_local_module("samplers/surehold", registry_root=str(HUB))
    f, noise = sh.problems.GM(), module.InputNoise.unit(0.1)
    space = dict(zip(f.box.names, zip(f.box.lower, f.box.upper, strict=True), strict=True))
    sampler = module.SureholdSampler(space, input_noise=noise, seed=2)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    study.optimize(lambda trial: float(f([trial.suggest_float(name, *space[name]) for name in space])), n_trials=50)
    answer = sampler.optimizer(study).recommend().x
    highest = [study.best_params[name] for name in space]
    best = sh.problems.robust_optimum(f, noise).x
    held, spike, most = (sh.problems.robust_score(f, x, noise, n=2000, seed=1).mean for x in (answer, highest, best))
    assert held > 0.9 * most
    assert held > 1.1 * spike
