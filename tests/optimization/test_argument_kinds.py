"""Arguments of a kind that cannot be: one line that names them."""

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.box import Box
from surehold.optimization.evaluation import evaluate
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

BOX = Box({"a": (0.0, 1.0), "b": (-1.0, 2.0)})
STRANGE = [
    [1],
    {},
    (1, 2, 3),
    np.array([1.0, 2.0]),
    b"x",
    complex(1, 1),
    object(),
    np.datetime64("2020-01-01"),
    np.ma.masked,
]
NAMES = [
    "direction",
    "criterion",
    "design",
    "noise",
    "quadrature",
    "border",
    "risk",
    "noise_while_exploring",
    "trust_region",
    "preset",
    "failures",
    "outcome",
    "feasible",
    "safety",
    "k",
    "kappa",
    "output_range",
    "surrogate",
]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", STRANGE, ids=lambda value: type(value).__name__)
def test_one_line_names_the_argument(name, value):
    with pytest.raises(InputError, match=f"^{name} is ") as refused:
        Optimizer(BOX, **{name: value})
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 250


def test_a_class_is_no_surrogate():
    with pytest.raises(InputError, match=r"surrogate is <class .*; give a name, an object"):
        Optimizer(BOX, surrogate=GaussianProcess)


@pytest.mark.parametrize("value", [-1, "a", [1], np.array([1.0])])
def test_fixed_is_a_dictionary(value):
    with pytest.raises(InputError, match=r"^fixed is "):
        Optimizer(BOX, fixed=value)


def test_while_nothing_is_feasible_everything_promises():
    optimizer = Optimizer(BOX, constraints={"torque": (None, 0.0)}, n_initial=3, seed=0)
    for _ in range(4):
        optimizer.tell(optimizer.ask(), 1.0, constraints={"torque": 1.0})
    assert optimizer.promise() == np.inf


@pytest.mark.parametrize("values", [(1e300, -1e300, 0.0, 1e299), (1e-320, 0.0, 1e-310, 0.0)])
def test_values_at_the_ends_of_the_numbers_do_no_harm(values):
    optimizer = Optimizer(BOX, n_initial=3, seed=0)
    for value in values:
        optimizer.tell(optimizer.ask(), value)
    assert BOX.contains(optimizer.recommend().x)
    assert BOX.contains(optimizer.ask())


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({}, {"y": 1e308}),
        ({"noise": "told"}, {"y": 1.0, "noise": 1e200}),
        ({"constraints": {"torque": (None, 1.0)}}, {"y": 1.0, "constraints": {"torque": -1e308}}),
    ],
)
def test_numbers_of_which_no_model_can_be_made_are_refused(settings, told):
    optimizer = Optimizer(BOX, seed=0, **settings)
    with pytest.raises(InputError, match=r"another unit|1e\+150") as refused:
        optimizer.tell([0.5, 0.5], **told)
    assert "\n" not in str(refused.value)
    assert len(optimizer.y) == 0
    y, noise, torque = told["y"], told.get("noise"), told.get("constraints", {}).get("torque")
    rows = {"noise": None if noise is None else [noise], "outputs": None if torque is None else [[torque]]}
    with pytest.raises(InputError, match=r"1e\+300|1e\+150"):
        optimizer.restore([[0.5, 0.5]], [y], **rows)


def test_a_function_that_returns_such_a_number_has_failed():
    value, why, _ = evaluate(lambda x: -1e308, np.zeros(1))
    assert np.isnan(value)
    assert why == "returned -1e+308"


def test_numbers_beyond_the_range_of_floats():
    huge = 10**400
    for name in ("k", "kappa", "noise", "feasible"):
        with pytest.raises(InputError, match=f"^{name} is "):
            Optimizer(BOX, **{name: huge})
    for value in (huge, 1e308):
        with pytest.raises(InputError, match="standard deviation"):
            InputNoise.unit(value)
        with pytest.raises(InputError, match="standard deviation"):
            InputNoise({"a": value})
    with pytest.raises(InputError, match="not a numeric matrix"):
        InputNoise(covariance=[[huge]])
    optimizer = Optimizer(BOX, constraints={"torque": (None, 0.0)})
    with pytest.raises(InputError, match="torque"):
        optimizer.tell([0.5, 0.5], 1.0, constraints={"torque": huge})


def test_counts_beyond_measure():
    for f in (
        lambda: Optimizer(BOX).ask(10**9),
        lambda: Optimizer(BOX, n_initial=10**9).ask(),
        lambda: Box.unit(10**9),
    ):
        with pytest.raises(InputError, match="0,000"):
            f()
