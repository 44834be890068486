"""What is remembered between asks."""

import numpy as np
import pytest

from surehold.optimization.surrogates.memory import Remembered, fingerprint, learnt_from


def test_a_value_is_made_once_and_the_one_not_used_for_longest_is_made_again():
    made: list[bytes] = []
    memory = Remembered[bytes](2)

    def value(key: bytes) -> bytes:
        def make() -> bytes:
            made.append(key)
            return key * 2

        return memory.value(key, make)

    assert [value(key) for key in (b"a", b"b", b"a", b"c", b"a", b"b")] == [b"aa", b"bb", b"aa", b"cc", b"aa", b"bb"]
    assert made == [b"a", b"b", b"c", b"b"]  # b was not used for longest when c came
    memory.clear()
    value(b"a")
    assert made[-1] == b"a"


def test_what_could_not_be_made_is_not_remembered():
    memory = Remembered[int]()
    with pytest.raises(ZeroDivisionError):
        memory.value(b"a", lambda: 1 // 0)
    assert memory.value(b"a", lambda: 1) == 1


def test_a_fingerprint_is_of_values_shape_noise_and_settings():
    X, y = np.arange(6.0).reshape(3, 2), np.arange(3.0)
    same = fingerprint(X, y, None)
    assert fingerprint(np.asfortranarray(X), y.copy(), None) == same
    others = [
        fingerprint(X.reshape(2, 3), y, None),
        fingerprint(X, np.nextafter(y, 9.0), None),
        fingerprint(X, y, y),
        fingerprint(X, y, None, 1),
    ]
    assert len({same, *others}) == 5


@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 31, 32, 100, 999, 4096])
def test_at_most_a_sixteenth_of_the_trials_waits_to_be_learnt_from(n):
    k = learnt_from(n)
    assert n - n / 16 < k <= n
    assert learnt_from(k) == k
