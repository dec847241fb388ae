"""Executors: order, exceptions, workers that die, interruptions."""

import multiprocessing
import os
import signal
import threading
import time

import pytest

from tubecert.executor import Processes, Serial, WorkerError, chosen, held

pytestmark = pytest.mark.timeout(120)


def slow_first(item: int) -> int:
    time.sleep(0.3 if item == 0 else 0)
    return item * item


def failing(item: int) -> int:
    if item == 1:
        raise ZeroDivisionError("of a worker")
    time.sleep(0.01)
    return item


def dying(item: int) -> int:
    if item == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def leaving(item: int) -> int:
    os._exit(1)


def sleeping(item: int) -> int:
    time.sleep(100)
    return item


def nobody_is_left() -> bool:
    """Whether all workers are gone: they were told to, and may take a moment on a machine that is busy."""
    end = time.monotonic() + 10
    while multiprocessing.active_children() and time.monotonic() < end:
        time.sleep(0.01)
    return not multiprocessing.active_children()


@pytest.mark.slow
@pytest.mark.parametrize("executor", [Serial(), Processes(2)])
def test_results_are_in_the_order_of_the_items(executor):
    assert executor.map(slow_first, range(5)) == [0, 1, 4, 9, 16]
    assert executor.map(slow_first, []) == []
    done: list[int] = []
    assert executor.map(slow_first, range(3), lambda place, found: done.append(place)) == [0, 1, 4]
    assert sorted(done) == [0, 1, 2]
    assert nobody_is_left()


@pytest.mark.slow
@pytest.mark.parametrize("executor", [Serial(), Processes(2)])
def test_an_exception_of_a_piece_is_raised(executor):
    with pytest.raises(ZeroDivisionError, match="of a worker"):
        executor.map(failing, range(50))
    with pytest.raises(ZeroDivisionError, match="of a worker"):
        executor.map(failing, range(50), lambda place, found: None)
    assert nobody_is_left()


@pytest.mark.slow
@pytest.mark.parametrize("function", [dying, leaving])
def test_a_worker_that_dies_is_told(function):
    with pytest.raises(WorkerError, match="killed, or out of memory"):
        Processes(2).map(function, range(4))
    assert nobody_is_left()


def who(item: int) -> int:
    return os.getpid()


@pytest.mark.slow
def test_processes_that_are_held_stay_until_one_fails_and_none_is_left():
    with held(Processes(1)) as pool:
        first = pool.map(who, range(2)) + pool.map(who, range(2))
        assert len(set(first)) == 1
        assert first[0] != os.getpid()
        with pytest.raises(ZeroDivisionError):
            pool.map(failing, range(3))
        assert nobody_is_left()
        assert pool.map(who, [0]) != first[:1]
    assert nobody_is_left()
    with held(None) as nothing, held(Serial()) as alone:
        assert nothing is None
        assert alone == Serial()


@pytest.mark.slow
def test_an_interruption_ends_the_workers():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(2, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    started = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            Processes(2).map(sleeping, range(4))
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - started < 30
    assert nobody_is_left()


def test_processes_are_used_where_they_help():
    assert chosen(4, 2) == Processes(2)
    assert chosen(1, 9) == chosen(4, 1) == chosen(4, 0) == Serial()
