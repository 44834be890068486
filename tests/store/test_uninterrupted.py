import os
import signal
import threading

import pytest

from surehold.optimization.evaluation import evaluate
from surehold.store.uninterrupted import uninterrupted


def ctrl_c():
    os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_waits_for_the_end_of_the_outermost_block():
    done = []

    def nested():
        with uninterrupted():
            with uninterrupted():
                ctrl_c()
                done.append("inner")
            done.append("outer")
        done.append("after")

    with pytest.raises(KeyboardInterrupt):
        nested()
    assert done == ["inner", "outer"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_second_ctrl_c_does_not_wait():
    done = []

    @uninterrupted()
    @uninterrupted()
    def impatient():
        ctrl_c()
        done.append("first")
        ctrl_c()
        done.append("second")

    with pytest.raises(KeyboardInterrupt):
        impatient()
    assert done == ["first"]


def test_without_a_signal_and_in_a_thread_nothing_changes():
    seen = []

    def work():
        with uninterrupted():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    with uninterrupted():
        pass
    assert seen == [signal.getsignal(signal.SIGINT)] == [signal.default_int_handler]


def test_what_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with uninterrupted():
            ctrl_c()
    finally:
        signal.signal(signal.SIGINT, before)


def test_ctrl_c_that_comes_out_of_compiled_code_as_another_error_is_no_failed_trial():
    def f(x):
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    with pytest.raises(KeyboardInterrupt):
        evaluate(f, {"x": 1.0})
