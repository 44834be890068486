"""The generator under the loop of gest-api and, where it is installed, under that of Xopt itself."""

import numpy as np
import pytest

import surehold as sh
from surehold.errors import InputError

gest_api = pytest.importorskip("gest_api.vocs")
VOCS = gest_api.VOCS

from surehold.gest import RobustGenerator  # noqa: E402  (needs gest-api)

NOISE = sh.InputNoise.unit(0.1)
GM = sh.problems.GM()


def gm(point):
    return {"f": float(GM([point["x"], point["y"]]))}


def gm_vocs(**more):
    bounds = dict(zip("xy", zip(GM.box.lower, GM.box.upper, strict=True), strict=True))
    return VOCS(
        variables={k: [float(a), float(b)] for k, (a, b) in bounds.items()}, objectives={"f": "MAXIMIZE"}, **more
    )


def held(x):
    return sh.problems.robust_score(GM, x, NOISE, n=2000, seed=1).mean


def test_it_finds_what_holds_where_a_plain_run_finds_the_spike():
    robust, plain = (RobustGenerator(gm_vocs(), input_noise=noise, seed=0) for noise in (NOISE, None))
    for generator in (robust, plain):
        for _ in range(50):
            (point,) = generator.suggest(1)
            generator.ingest([point | gm(point)])
    assert held(robust.recommend().x) > 0.9 * held(sh.problems.robust_optimum(GM, NOISE).x)
    assert held(robust.recommend().x) > held(plain.recommend().x)


def test_under_xopt():
    xopt = pytest.importorskip("xopt")
    generator = RobustGenerator(gm_vocs(), input_noise=NOISE, seed=0)
    loop = xopt.Xopt(generator=generator, evaluator=xopt.Evaluator(function=gm))
    for _ in range(50):
        loop.step()
    assert len(loop.data) == 50
    found = loop.generator.recommend()
    assert held(found.x) > 0.9 * held(sh.problems.robust_optimum(GM, NOISE).x)


def test_minimizing_constants_choices_and_limits():
    vocs = VOCS(
        variables={"x": [0.0, 1.0], "mode": {1, 2}},
        objectives={"f": "MINIMIZE"},
        constraints={"g": ["LESS_THAN", 0.5]},
        constants={"c": 3.0},
    )
    generator = RobustGenerator(vocs, seed=0)
    for _ in range(25):
        (point,) = generator.suggest()
        assert point["c"] == 3.0
        assert point["mode"] in (1, 2)
        generator.ingest([point | {"f": -point["x"] + point["mode"], "g": point["x"]}])
    x = generator.optimizer.box.as_dict(generator.recommend().x)
    assert x["mode"] == "1"
    assert 0.4 < x["x"] < 0.55, "the limit x <= 0.5 is not where the answer is"


def test_points_of_others_failures_and_unknown_ids():
    generator = RobustGenerator(gm_vocs())
    first, second = generator.suggest(2)
    assert first["_id"] != second["_id"]
    generator.ingest([first | {"f": np.nan}, {"x": 0.5, "y": 0.5, "f": 0.3}])
    np.testing.assert_array_equal(generator.optimizer.y, [np.nan, 0.3])
    assert len(generator.optimizer.pending) == 1
    with pytest.raises(InputError, match="point 99 is not under way"):
        generator.ingest([{"x": 0.5, "y": 0.5, "f": 0.3, "_id": 99}])


def test_a_point_without_its_constraint_stays_under_way():
    vocs = VOCS(variables={"x": [0.0, 1.0]}, objectives={"f": "MAXIMIZE"}, constraints={"c": ["LESS_THAN", 0.5]})
    generator = RobustGenerator(vocs)
    (point,) = generator.suggest()
    with pytest.raises(InputError, match="lacks c"):
        generator.ingest([point | {"f": 1.0}])
    generator.ingest([point | {"f": 1.0, "c": 0.1}])
    np.testing.assert_array_equal(generator.optimizer.y, [1.0])


@pytest.mark.parametrize(
    ("vocs", "message"),
    [
        ({"variables": {"x": [0, 1]}, "objectives": {"f": "MINIMIZE", "g": "MINIMIZE"}}, "objectives are f, g"),
        ({"variables": {"x": [0, 1]}, "objectives": {"f": "EXPLORE"}}, "give one, to be minimized or maximized"),
        ({"variables": {"x": [0, np.inf]}, "objectives": {"f": "MINIMIZE"}}, "'x' has no finite domain"),
    ],
)
def test_what_is_refused(vocs, message):
    with pytest.raises(ValueError, match=message):
        RobustGenerator(VOCS(**vocs))


def test_a_misspelt_setting_is_named():
    with pytest.raises(InputError, match="did you mean 'criterion'"):
        RobustGenerator(gm_vocs(), criteron="ei")


def test_the_direction_has_one_owner():
    with pytest.raises(InputError, match="those of its vocs"):
        RobustGenerator(gm_vocs(), direction="minimize")


LIMITED = {"constraints": {"g": ["LESS_THAN", 0.5]}}


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"_id": 1, "f": 0.5}, "lacks g"),
        ({"_id": 1, "f": "bad", "g": 0.1}, "f is 'bad'; give one number"),
        ({"_id": 1, "f": 0.5, "g": "bad"}, "g is 'bad'; give one number"),
        ({"_id": 0, "f": 0.5, "g": 0.1}, "hold an _id twice"),
        ({"x": 0.2, "f": 0.5, "g": 0.1}, "lacks mode"),
        ({"x": 1.2, "mode": 1, "f": 0.5, "g": 0.1}, "outside"),
        ({"x": 0.2, "mode": 7, "f": 0.5, "g": 0.1}, "choice for 'mode' '7' is unknown"),
    ],
)
def test_of_points_with_a_bad_one_none_is_taken(bad, message):
    vocs = VOCS(variables={"x": [0.0, 1.0], "mode": {1, 2}}, objectives={"f": "MINIMIZE"}, **LIMITED)
    generator = RobustGenerator(vocs)
    first, second = (point | {"f": 0.3, "g": 0.1} for point in generator.suggest(2))
    with pytest.raises(InputError, match=message):
        generator.ingest([first, bad])
    assert len(generator.optimizer.y) == 0
    generator.ingest([first, second])
    assert generator.optimizer.y.tolist() == [0.3, 0.3]


def test_whole_numbers_may_come_back_as_floats():
    generator = RobustGenerator(VOCS(variables={"n": {1, 2, 4}}, objectives={"f": "MINIMIZE"}))
    generator.ingest([{"n": 2.0, "f": 0.3}, {"n": np.int64(4), "f": 0.1}])
    assert generator.recommend().parameters == {"n": 4}


@pytest.mark.parametrize("settings", [{"outcome": "success"}, {"outcome": "preference"}, {"noise": "told"}], ids=str)
def test_points_tell_a_value_alone(settings):
    with pytest.raises(InputError, match=r"take a surehold\.Optimizer"):
        RobustGenerator(gm_vocs(), **settings)
