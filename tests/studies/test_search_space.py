import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

import surehold as sh
from surehold.errors import InputError
from surehold.optimization.noise.input_noise import noise_of_coordinates
from surehold.studies.parameter_text import parse_search_space
from surehold.studies.search_space import SearchSpace

DISTRIBUTIONS = {
    "dx": FloatDistribution(-0.05, 0.05),
    "force": FloatDistribution(0.1, 100.0, log=True),
    "turn": FloatDistribution(-1.0, 1.0, step=0.25),
    "fingers": IntDistribution(2, 5),
    "speed": IntDistribution(1, 1000, log=True),
    "grip": CategoricalDistribution(["pinch", "power", None]),
    "only": IntDistribution(7, 7),
}
SPACE = SearchSpace(DISTRIBUTIONS)


def internal(parameters):
    return {name: DISTRIBUTIONS[name].to_internal_repr(value) for name, value in parameters.items()}


@given(st.integers(0, 2**32 - 1))
def test_every_point_of_the_box_is_a_trial_and_maps_back(seed):
    u = np.random.default_rng(seed).random(SPACE.box.dimension)
    parameters = SPACE.decode(SPACE.box.from_unit(u))
    assert SPACE.contains(parameters)
    for name, distribution in DISTRIBUTIONS.items():
        assert distribution._contains(distribution.to_internal_repr(parameters[name]))
    again = SPACE.decode(SPACE.encode(parameters))
    assert internal(again) == pytest.approx(internal(parameters), rel=1e-14)
    snapped = SPACE.box.snap(u)
    assert internal(SPACE.decode(SPACE.box.from_unit(snapped))) == pytest.approx(internal(parameters), rel=1e-9)
    assert np.allclose(SPACE.box.snap(snapped), snapped, rtol=0, atol=1e-12)
    assert np.allclose(SPACE.box.from_unit(snapped), SPACE.encode(parameters), rtol=0, atol=1e-9)


def test_levels_have_equal_shares_of_the_box():
    space = SearchSpace({"k": IntDistribution(2, 6)})
    u = np.linspace(0.0, 1.0, 50_001)[:, None]
    values = [space.decode(x)["k"] for x in space.box.from_unit(u)]
    counts = np.bincount(values)[2:]
    assert counts.max() - counts.min() <= 2
    assert all(type(v) is int for v in values)


def test_the_types_are_plain():
    parameters = SPACE.decode(SPACE.box.from_unit(np.full(SPACE.box.dimension, 0.4)))
    kinds = {name: type(value) for name, value in parameters.items()}
    assert kinds["dx"] is float
    assert kinds["speed"] is int
    assert kinds["only"] is int
    assert parameters["only"] == 7
    assert list(parameters) == list(DISTRIBUTIONS)


def test_all_of_a_box_of_numbers_can_be_tried():
    box = sh.Box({"a": (0.0, 2.0), "b": (-1.0, 1.0)})
    space = SearchSpace(box)
    assert space.box.plain
    assert space.box == box
    assert SearchSpace({"a": (0.0, 2.0), "b": (-1.0, 1.0)}).box == box


def test_json_round_trip():
    assert SearchSpace.from_json(SPACE.to_json()).distributions == DISTRIBUTIONS


def test_choices_carry_no_noise():
    noise = sh.InputNoise({"dx": 0.003, "force": 0.1, "turn": 0.0, "fingers": 0.2, "speed": 0.0})
    found = noise_of_coordinates(noise, SPACE.box).unit_covariance(SPACE.box)
    deviations = dict(zip(SPACE.box.names, np.sqrt(np.diag(found)) * SPACE.box.widths, strict=True))
    assert deviations["dx"] == pytest.approx(0.003)
    assert deviations["force"] == pytest.approx(0.1)
    assert [v for name, v in deviations.items() if name.startswith("grip")] == [0.0] * 3
    unit = noise_of_coordinates(sh.InputNoise.unit(0.1), SPACE.box).unit_covariance(SPACE.box)
    assert np.count_nonzero(np.diag(unit)) == 5


def test_correlated_noise_is_of_the_numbers_and_choices_carry_none():
    covariance = 1e-4 * (np.eye(5) + 0.3)
    unit = noise_of_coordinates(sh.InputNoise(covariance=covariance), SPACE.box).unit_covariance(SPACE.box)
    numbers = SPACE.box.numbers
    own = [SPACE.box.names.index(name) for name in numbers.names]
    np.testing.assert_allclose(unit[np.ix_(own, own)], covariance / np.outer(numbers.widths, numbers.widths))
    assert np.count_nonzero(unit) == 25


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        (sh.InputNoise({"dx": 0.003}), "says nothing about"),
        (sh.InputNoise({"grip": 0.1}), "'grip' is unknown"),
        (sh.InputNoise(covariance=np.eye(4) + 0.1), "has 4 rows"),
    ],
)
def test_noise_that_cannot_be_is_refused(noise, message):
    with pytest.raises(InputError, match=message):
        noise_of_coordinates(noise, SPACE.box)
    with pytest.raises(InputError, match="all variables are choices"):
        noise_of_coordinates(sh.InputNoise.unit(0.1), sh.Box({"c": ["a", "b"]}))


GOOD = {"dx": 0.01, "force": 3, "turn": "0.5", "fingers": 3.0, "speed": "10", "grip": "None", "only": 7}


def test_parameters_from_text_are_converted():
    checked = SPACE.check(GOOD)
    assert checked == {"dx": 0.01, "force": 3.0, "turn": 0.5, "fingers": 3, "speed": 10, "grip": None, "only": 7}
    assert type(checked["fingers"]) is int


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dx": 0.06}, "outside its range from -0.05 to 0.05"),
        ({"dx": math.nan}, "finite"),
        ({"dx": math.inf}, "finite"),
        ({"dx": "far"}, "give a finite number"),
        ({"dx": True}, "give a finite number"),
        ({"dx": None}, "give a finite number"),
        ({"turn": 0.3}, "no level"),
        ({"fingers": 2.5}, "no level"),
        ({"grip": "pnch"}, "did you mean 'pinch'"),
        ({"dz": 0.0}, "'dz' is unknown"),
        ({"dx": 10**400}, "give a finite number"),
    ],
)
def test_bad_parameters_are_named(change, message):
    with pytest.raises(InputError, match=message):
        SPACE.check(GOOD | change)


def test_missing_parameters_are_named():
    with pytest.raises(InputError, match="say nothing about grip"):
        SPACE.check({k: v for k, v in GOOD.items() if k != "grip"})


@pytest.mark.parametrize("bad", [{}, {"x": (1.0, 0.0)}, {"x": (0.0, math.inf)}, {"x": "0:1"}, 3])
def test_bad_spaces_are_refused(bad):
    with pytest.raises(InputError):
        SearchSpace(bad)


def test_infinite_distributions_are_refused():
    with pytest.raises(InputError, match="finite"):
        SearchSpace({"x": FloatDistribution(0.0, math.inf)})


def test_choices_that_optuna_takes_for_one_are_refused():
    equal = CategoricalDistribution([None, True, 1, "x"])
    assert equal.to_external_repr(equal.to_internal_repr(1)) is True  # asked for 1, stored as True, asked for again
    with pytest.raises(InputError, match="the choices True and 1, which are equal"):
        SearchSpace({"a": equal})
    assert SearchSpace({"a": CategoricalDistribution([None, True, 2, "1"])}).box is not None


def test_bounds_in_single_precision_are_the_bounds():
    single = float(np.float32(0.05))
    assert single > 0.05
    assert SearchSpace({"dx": (-0.05, 0.05)}).check({"dx": single}) == {"dx": 0.05}


def test_a_study_does_not_choose_what_nobody_sets():
    with pytest.raises(InputError, match=r"uncontrolled: payload.*take a surehold\.Optimizer"):
        SearchSpace(sh.Box({"grip": (0.0, 1.0)}, uncontrolled={"payload": [0.2, 0.3, 0.8]}))


@pytest.mark.parametrize("box", [sh.Box({"x": (0.0, 1.0, "step=0.3"), "n": (0, 10, "int", "step=3")}), None])
def test_steps_that_do_not_divide_the_range_keep_their_last_level_and_nothing_is_warned_of(box):
    space = parse_search_space("x=0:1:step=0.3,n=0:10:int:step=3") if box is None else SearchSpace(box)
    assert space.distributions == {"x": FloatDistribution(0.0, 0.9, step=0.3), "n": IntDistribution(0, 9, step=3)}
    last = space.check({"x": 0.9, "n": 9})
    assert last == pytest.approx({"x": 0.9, "n": 9})
    assert space.contains(last)
    assert SearchSpace.from_json(space.to_json()).distributions == space.distributions
