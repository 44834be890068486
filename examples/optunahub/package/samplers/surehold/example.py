"""Maximize a function with a narrow and a broad peak; the input strays by 3 % of its range."""

import math

import optuna
import optunahub

module = optunahub.load_module("samplers/surehold")


def objective(trial: optuna.Trial) -> float:
    """Return a spike at 0.2 and a hill at 0.7."""
    x = trial.suggest_float("x", 0.0, 1.0)
    return 1.5 * math.exp(-0.5 * ((x - 0.2) / 0.01) ** 2) + math.exp(-0.5 * ((x - 0.7) / 0.1) ** 2)


sampler = module.SureholdSampler({"x": (0.0, 1.0)}, input_noise=module.InputNoise.unit(0.03), seed=0)
study = optuna.create_study(direction="maximize", sampler=sampler)
study.optimize(objective, n_trials=40)
print("highest observed:", study.best_params)
print("holds when the input is off:", sampler.optimizer(study).recommend().x)
