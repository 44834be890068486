import copy
import json
import pickle

import numpy as np
import pytest

from surehold.errors import InputError
from surehold.optimization.acquisition.risk_measures import Risk
from surehold.optimization.box import Box
from surehold.optimization.noise.input_noise import InputNoise
from surehold.optimization.optimizer import Optimizer
from surehold.optimization.surrogates.gaussian_process.model import GaussianProcess

BOX = Box({"a": (-0.3, 0.7), "b": (3.0, 7.1)})

TRIAL = {"number": 0, "commanded": [0.1, 0.2], "reached": [0.1, 0.2], "value": 1.0}


def used(n=8, **settings):
    optimizer = Optimizer(BOX, n_initial=5, seed=4, **settings)
    for i in range(n):
        x = optimizer.ask()
        optimizer.tell(x, None if i == 3 else -float((x**2).sum()), failed=i == 3, reached=x + 0.3 if i == 1 else None)
    optimizer.forget(optimizer.ask(2)[0])
    return optimizer


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"direction": "minimize"},
        {"input_noise": InputNoise({"a": 0.1, "b": 0.2}), "risk": "mean-std"},
        {"input_noise": InputNoise.uniform({"a": 0.1, "b": 0.0})},
        {"input_noise": InputNoise(covariance=[[0.01, 0.005], [0.005, 0.04]]), "criterion": "uei"},
        {"input_noise": InputNoise.unit(0.05), "risk": Risk("cvar", alpha=0.2)},
        {"fixed": {"b": np.float64(4.0)}, "initial_points": [{"a": 0.5, "b": 4.0}], "output_range": (-60.0, 0.0)},
    ],
    ids=str,
)
def test_a_loaded_optimizer_goes_on_as_the_saved_one(tmp_path, settings):
    saved = used(**settings)
    saved.save(tmp_path / "run.json")
    loaded = Optimizer.load(tmp_path / "run.json")
    for name in ("X", "y", "reached", "pending"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(saved, name))
    assert loaded.direction == saved.direction
    assert np.array_equal(loaded.recommend().x, saved.recommend().x)
    assert np.array_equal(loaded.ask(2), saved.ask(2))


def few(x):
    """Is below a place: of {name: value}, as of x (d,)."""
    return (x["n"] if isinstance(x, dict) else x[0]) < 9


def twentieth(x):
    """Return deviations of a twentieth, everywhere."""
    return np.full(len(x), 0.05)


@pytest.mark.parametrize(
    ("variables", "settings"),
    [
        ({"x": (0.0, 1.0), "y": (0.0, 1.0)}, {"fixed": {"y": 0.5}}),
        ({"n": (0, 9, "int"), "c": ["a", "b"]}, {"fixed": {"c": "b"}}),
        ({"n": (0, 20, "int")}, {"allowed": few}),
        ({"n": (1.0, 20.0, "log")}, {"allowed": "n <= 10"}),
        ({"x": (0.0, 1.0)}, {"allowed": few, "input_noise": InputNoise.varying(twentieth)}),
    ],
    ids=["fixed", "fixed choice", "function by name", "weights of a logarithm", "varying noise"],
)
@pytest.mark.parametrize("copied", [lambda o: pickle.loads(pickle.dumps(o)), copy.deepcopy], ids=["pickle", "deepcopy"])
def test_a_pickled_optimizer_goes_on_as_the_one_it_was_made_of(variables, settings, copied):
    optimizer = Optimizer(Box(variables), n_initial=3, seed=1, **settings)
    for i in range(4):
        optimizer.tell(optimizer.ask_trial(), float(i % 3))
    other = copied(optimizer)
    np.testing.assert_array_equal(other.ask_trial().x, optimizer.ask_trial().x)
    assert other.recommend().mean == optimizer.recommend().mean


def test_an_infinite_limit_is_none(tmp_path):
    limits = {"force": (-np.inf, 0.5), "torque": (np.float32(0.0), np.inf), "heat": (-np.inf, np.inf)}
    saved = Optimizer(BOX, constraints=limits, n_initial=4, seed=0)
    for _ in range(6):
        x = saved.ask()
        saved.tell(x, -float(x @ x), constraints={"force": float(x[0]), "torque": float(x[1])})
    saved.save(tmp_path / "run.json")
    stored = json.loads((tmp_path / "run.json").read_text())["settings"]["constraints"]
    assert stored == {"force": [None, 0.5], "torque": [0.0, None], "heat": [None, None]}
    loaded = Optimizer.load(tmp_path / "run.json")
    assert loaded.limits == saved.limits
    assert np.array_equal(loaded.ask(), saved.ask())


def test_parameters_of_a_risk_may_be_of_numpy(tmp_path):
    saved = Optimizer(BOX, input_noise=InputNoise.unit(0.05), risk=Risk("cvar", alpha=np.float32(0.25)))
    saved.save(tmp_path / "run.json")
    assert Optimizer.load(tmp_path / "run.json").risk == Risk("cvar", alpha=0.25)


@pytest.mark.parametrize("name", ["risk", "linear", "input noise", "object that is not stored"])
def test_users_choose_the_names_of_outputs_and_variables(tmp_path, name):
    box = Box({name: (0.0, 1.0), "x": (0.0, 1.0)})
    optimizer = Optimizer(box, fixed={name: 0.25})
    optimizer.tell(optimizer.ask(), 1.0)
    optimizer.save(tmp_path / "fixed.json")
    assert np.array_equal(Optimizer.load(tmp_path / "fixed.json").X, optimizer.X)
    optimizer = Optimizer(box, guess={name: 0.25})
    optimizer.save(tmp_path / "guess.json")
    assert np.array_equal(Optimizer.load(tmp_path / "guess.json").ask(), optimizer.ask())
    optimizer = Optimizer(BOX, constraints={name: (None, 3.0)})
    optimizer.tell(optimizer.ask(), 1.0, constraints={name: 2.0})
    optimizer.save(tmp_path / "outputs.json")
    assert Optimizer.load(tmp_path / "outputs.json").outputs[name].tolist() == [2.0]


def test_values_stay_as_told_where_the_direction_is_replaced(tmp_path):
    optimizer = used()
    optimizer.save(tmp_path / "run.json")
    turned = Optimizer.load(tmp_path / "run.json", direction="minimize")
    assert np.array_equal(turned.y, optimizer.y, equal_nan=True)
    lowest = int(np.nanargmin(turned.y))
    assert turned.recommend().observed == optimizer.y[lowest]


def test_outputs_stay_those_of_their_names_where_constraints_are_replaced(tmp_path):
    optimizer = Optimizer(BOX, constraints={"torque": (None, 3.0), "force": (None, 50.0)})
    for torque in (1.0, 2.0):
        optimizer.tell(optimizer.ask(), 1.0, constraints={"torque": torque, "force": None if torque > 1.0 else 40.0})
    optimizer.tell(optimizer.ask(), failed=True)
    optimizer.save(tmp_path / "run.json")
    others = {"force": (None, 45.0), "heat": (None, 1.0), "torque": (None, 3.0)}
    outputs = Optimizer.load(tmp_path / "run.json", constraints=others).outputs
    assert np.array_equal(outputs["torque"], [1.0, 2.0, np.nan], equal_nan=True)
    assert np.array_equal(outputs["force"], [40.0, np.nan, np.nan], equal_nan=True)
    assert np.isnan(outputs["heat"]).all()
    assert Optimizer.load(tmp_path / "run.json", constraints=None).outputs == {}


def test_the_box_cannot_be_replaced(tmp_path):
    used().save(tmp_path / "run.json")
    with pytest.raises(InputError, match="box cannot be replaced"):
        Optimizer.load(tmp_path / "run.json", box=BOX)


def test_before_any_trial(tmp_path):
    Optimizer(BOX, seed=2).save(tmp_path / "run.json")
    assert np.array_equal(Optimizer.load(tmp_path / "run.json").ask(), Optimizer(BOX, seed=2).ask())


def test_what_a_file_cannot_hold_is_asked_for(tmp_path):
    process = GaussianProcess(kernel="matern32")
    saved = used(surrogate=process)
    saved.save(tmp_path / "run.json")
    with pytest.raises(InputError, match=r"surrogate was .*GaussianProcess.*surrogate=\.\.\."):
        Optimizer.load(tmp_path / "run.json")
    assert np.array_equal(Optimizer.load(tmp_path / "run.json", surrogate=process).ask(), saved.ask())


def test_bad_files(tmp_path):
    good = tmp_path / "good.json"
    used(0).save(good)
    data = json.loads(good.read_text())
    cases = {
        "is no JSON": "{",
        "holds no optimizer": "[1, 2]",
        "format 99": json.dumps(data | {"version": 99}),
        "is damaged": json.dumps({name: data[name] for name in data if name != "trials"}),
        "damaged: ValueError": json.dumps(data | {"trials": [TRIAL | {"commanded": [0.1]}]}),
        "damaged: TypeError|damaged: ValueError": json.dumps(data | {"trials": [TRIAL | {"commanded": [{}, 1.0]}]}),
        "outside of the box": json.dumps(data | {"trials": [TRIAL | {"commanded": [0.1, 1.1]}]}),
        "different whole numbers": json.dumps(data | {"trials": [TRIAL, TRIAL]}),
        "damaged: OverflowError": json.dumps(data | {"trials": [TRIAL | {"value": 10**400}]}),
        "'sead' is unknown; did you mean 'seed'": json.dumps(data | {"settings": {"sead": 1}}),
    }
    for words, text in cases.items():
        bad = tmp_path / "bad.json"
        bad.write_text(text)
        with pytest.raises(InputError, match=words):
            Optimizer.load(bad)
    with pytest.raises(InputError, match="cannot be read"):
        Optimizer.load(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be written"):
        used(0).save(tmp_path / "no" / "folder.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.json", "good.json"]


def test_a_save_that_is_cut_off_leaves_the_file_from_before_and_nothing_else(tmp_path, monkeypatch):
    def cut_off(handle):
        raise KeyboardInterrupt

    optimizer = used(0)
    optimizer.save(tmp_path / "run.json")
    before = (tmp_path / "run.json").read_bytes()
    optimizer.tell([0.5, 4.0], 0.7)
    monkeypatch.setattr("os.fsync", cut_off)  # after which the content is on the disk, where the name may come earlier
    with pytest.raises(KeyboardInterrupt):
        optimizer.save(tmp_path / "run.json")
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]
    assert (tmp_path / "run.json").read_bytes() == before
