"""The public calls of optimizers, with random settings among which strange values are strewn."""

import random
from typing import Any

import numpy as np

import surehold as sh
from benchmarks.fuzz.findings import Findings

STRANGE: list[Any] = [
    None, float("nan"), float("inf"), -1, 0, 1e308, -1e308, 1e-320, "x", "", "0.5", True, [], [1], {}, {"a": 1}, (1, 2),
    np.array([1.0, 2.0]), b"x", 10**400, -(10**400), object(), "\ud800", complex(1, 1), [["a"]],
    np.datetime64("2020-01-01"), np.ma.masked, lambda x: x,
]  # fmt: skip
SETTINGS: dict[str, list[Any]] = {
    "direction": ["maximize", "minimize"],
    "surrogate": ["gp", "tgp", "two_scales", "local_global"],
    "criterion": ["ei", "uei", "robust_ei", "pi", "ucb", "log_ei", "thompson", "robust_thompson"],
    "n_initial": [1, 3, 5],
    "design": ["sobol", "uniform", "latin_hypercube"],
    "noise": ["none", "inferred", "heteroscedastic", 0.1, "told"],
    "quadrature": ["unscented", "quasi_monte_carlo", "gauss_hermite", "central_difference", "closed_form"],
    "border": ["extend", "clip", "keep"],
    "risk": ["mean", "mean-std", "var", "cvar", "worst", "mean-variance"],
    "noise_while_exploring": [True, False],
    "trust_region": [True, False],
    "preset": ["thesis", "thesis-gm"],
    "allowed": ["a <= 0.5", "a + b <= 1", lambda x: True, lambda x: x[0] > 2],
    "constraints": [{"t": (None, 1.0)}, {"t": (2.0, 1.0)}],
    "failures": ["lowest", "modelled"],
    "outcome": ["value", "success"],
    "feasible": [0.9, 0.5],
    "safety": [0.9],
    "k": [1.0, 0.1],
    "kappa": [0.0, 3.0],
    "output_range": [(0, 1), (1, 0)],
    "fixed": [{"a": 0.5}, {"z": 1}],
    "initial_points": [[[0.5, 0.5]], [{"a": 0.1, "b": 0.2}]],
    "seed": [0, 5],
}


def call(draw: random.Random, findings: Findings) -> None:
    """Make one optimizer, and ask, tell and answer with it."""
    attempt = findings.attempt
    box = attempt("box", lambda: _box(draw))
    if box is None:
        return
    settings = {
        name: draw.choice(STRANGE) if draw.random() < 0.07 else draw.choice(values)
        for name, values in SETTINGS.items()
        if draw.random() < 0.13
    }
    noise = attempt("input noise", lambda: _noise(draw))
    if draw.random() < 0.9:
        settings["input_noise"] = noise
    optimizer = attempt(f"construct {settings}", lambda: sh.Optimizer(box, **settings))
    if optimizer is None:
        return
    for _ in range(draw.randint(1, 10)):
        trial = attempt(f"ask {settings}", optimizer.ask_trial)
        if trial is None:
            break
        x = draw.choice(STRANGE) if draw.random() < 0.1 else draw.choice([trial, trial.x])
        told = _told(draw, settings, trial)
        attempt(f"tell {told}", lambda x=x, told=told: optimizer.tell(x, **told))
    for name in ("recommend", "promise", "diagnosis", "ask_trial"):
        attempt(f"{name} {settings}", getattr(optimizer, name))
    attempt("predict", lambda: optimizer.predict(draw.choice(STRANGE)))


def _told(draw: random.Random, settings: dict[str, Any], trial: sh.AskedTrial) -> dict[str, Any]:
    told: dict[str, Any] = {}
    if settings.get("outcome") == "success" and draw.random() < 0.8:
        told["success"] = draw.random() < 0.5
    elif draw.random() < 0.9:
        told["y"] = draw.choice(STRANGE) if draw.random() < 0.15 else draw.gauss(0.0, 1.0)
    if settings.get("constraints") and draw.random() < 0.9:
        told["constraints"] = {"t": draw.choice(STRANGE) if draw.random() < 0.1 else draw.gauss(1.0, 1.0)}
    if settings.get("noise") == "told" and draw.random() < 0.9:
        told["noise"] = 0.1
    if draw.random() < 0.1:
        told["failed"] = draw.choice([True, "rig", "x", None])
    if draw.random() < 0.1:
        told["reached"] = draw.choice([*STRANGE, trial.x + 0.1])
    return told


def _box(draw: random.Random) -> sh.Box:
    kind = draw.randrange(10)
    if kind == 0:
        name: Any = draw.choice([value for value in STRANGE if value is None or isinstance(value, (int, str, bytes))])
        return sh.Box({name: draw.choice(STRANGE)})
    if kind == 1:
        return sh.Box({"a": draw.choice(STRANGE), "b": (0, 1)})
    if kind < 4:
        return sh.Box({"a": (0.1, 10.0, "log"), "b": (0, 3, "int"), "g": ["p", "q"]})
    return sh.Box.unit(1) if kind < 6 else sh.Box({"a": (0.0, 1.0), "b": (-1.0, 2.0)})


def _noise(draw: random.Random) -> sh.InputNoise | None:
    kind = draw.randrange(7)
    if kind == 0:
        return sh.InputNoise.unit(draw.choice(STRANGE))
    if kind == 1:
        return sh.InputNoise(covariance=draw.choice(STRANGE))
    if kind == 2:
        return sh.InputNoise.samples(0.05 * np.random.default_rng(0).normal(size=(50, 2)))
    if kind == 3:
        return sh.InputNoise.uniform({"a": 0.1, "b": 0.1})
    if kind == 4:
        return sh.InputNoise({"a": 0.1, "b": 0.0})
    return None if kind == 5 else sh.InputNoise.unit(0.05)
