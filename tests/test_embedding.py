"""Random embeddings: the maps are those of the papers, trials are kept, and hidden functions are found."""

import numpy as np
import pytest

import surehold as sh
from surehold.embedding import NestedEmbedding, RandomEmbedding
from surehold.errors import InputError


def _hidden(x):
    return -float((x[3] - 0.4) ** 2 + (x[17] - 0.7) ** 2)


def test_hidden_variables_are_found_in_bins():
    search = NestedEmbedding(sh.Box.unit(30), trials=60, dimension=2, seed=1)
    for _ in range(60):
        x = search.ask()
        assert np.all((x >= 0.0) & (x <= 1.0))
        search.tell(x, _hidden(x))
    random = np.random.default_rng(0).random((200, 60, 30))
    assert search.best()[1] > 0.2 * np.median([max(_hidden(x) for x in run) for run in random])
    assert _hidden(search.best()[0]) == search.best()[1]


def test_the_best_point_of_a_subspace_is_found():
    search = RandomEmbedding(sh.Box.unit(30), dimension=2, seed=1)
    top = np.clip(0.5 + 0.5 * search._maps[0] @ [0.3, -0.2], 0.0, 1.0)
    for _ in range(40):
        x = search.ask()
        search.tell(x, -float(np.square(x - top).sum()))
    assert search.best()[1] > -0.01, "points of the box itself are 2.5 away at best"


def test_points_are_images_of_the_map_moved_to_the_border():
    search = RandomEmbedding(sh.Box.unit(40), dimension=3, seed=2)
    x = search.ask()
    A, z = search._maps[0], search._asked[0][2]
    assert A.shape == (40, 3)
    assert np.all(np.abs(z) <= np.sqrt(3.0))
    np.testing.assert_allclose(x, np.clip(0.5 + 0.5 * A @ z, 0.0, 1.0))


def test_embeddings_take_turns():
    search = RandomEmbedding(sh.Box.unit(10), dimension=2, embeddings=3, seed=0)
    for _ in range(6):
        search.ask()
    assert [turn for _, turn, _ in search._asked] == [0, 1, 2, 0, 1, 2]


def test_dividing_the_bins_keeps_every_trial_where_it_was():
    search = NestedEmbedding(sh.Box.unit(20), trials=40, dimension=2, seed=3)
    seen, sizes = [], []
    for _ in range(40):
        x = search.ask()
        search.tell(x, _hidden(x))
        seen.append(x)
        sizes.append(search.dimension)
        for place, tried in zip(search._places, seen, strict=True):
            np.testing.assert_allclose(search._spread(place), tried)
        assert sorted(np.concatenate(search._bins).tolist()) == list(range(20))
    assert sizes[0] == 2
    assert sorted(set(sizes)) == [2, 8, 20]


def test_bins_are_divided_while_trials_are_under_way():
    search = NestedEmbedding(sh.Box.unit(20), trials=40, dimension=2, seed=3)
    under_way, sizes = [search.ask() for _ in range(3)], []
    for _ in range(40):
        x = under_way.pop(0)
        search.tell(x, _hidden(x))
        under_way.append(search.ask())
        sizes.append(search.dimension)
        for waiting, (x, _, place) in zip(under_way, search._asked, strict=True):
            np.testing.assert_array_equal(x, waiting)
            np.testing.assert_allclose(search._spread(place), x)
    assert sorted(set(sizes)) == [2, 8, 20]
    assert len(search._optimizer.pending) == 3


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: RandomEmbedding(sh.Box.unit(3), dimension=4), "dimension is 4; give 1 to 3"),
        (lambda: RandomEmbedding(sh.Box.unit(3), dimension=0), "dimension is 0"),
        (lambda: NestedEmbedding(sh.Box.unit(3), trials=0, dimension=1), "0 embeddings or trials"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2, input_noise=sh.InputNoise.unit(0.1)), "input_noise is about"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2, allowed=lambda x: True), "allowed is about"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2, constraints={"a": (0.0, 1.0)}), "knows no constraints"),
        (lambda: NestedEmbedding(sh.Box.unit(3), 9, direction="minimize"), "knows no direction"),
        (lambda: RandomEmbedding(sh.Box({"n": (0, 9, "int"), "m": (0, 9, "int")}), 1), "of plain intervals"),
        (lambda: RandomEmbedding(sh.Box({"x": (0, 1)}, uncontrolled={"load": [1.0, 2.0]}), 1), "nobody sets"),
        (lambda: NestedEmbedding(sh.Box.unit(3), 9, noise="told"), "tell no noise"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2, seed=-1), "seed is -1"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2, criteron="ei"), "did you mean 'criterion'"),
        (lambda: NestedEmbedding(sh.Box.unit(3), 9, criteron="ei"), "did you mean 'criterion'"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2).best(), "no trial has given a value"),
        (lambda: RandomEmbedding(sh.Box.unit(3), 2).tell(np.zeros(3), 1.0), "was not asked for"),
    ],
)
def test_bad_input_is_said_in_one_line(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("search", [RandomEmbedding(sh.Box.unit(3), 2), NestedEmbedding(sh.Box.unit(3), 9, 2)])
def test_a_bad_answer_can_be_told_again(search):
    x = search.ask()
    with pytest.raises(InputError):
        search.tell(x, "a")
    search.tell(x, 1.0)
    assert search.best()[1] == 1.0


def test_the_first_stage_is_no_larger_than_the_box():
    assert NestedEmbedding(sh.Box.unit(2), trials=10).dimension == 2
    assert NestedEmbedding(sh.Box.unit(9), trials=10).dimension == 4
