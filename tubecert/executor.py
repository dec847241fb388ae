"""Who does independent pieces of work: this process, several, or a cluster.

`map` gives the results in the order of the items, whichever is ready first. An exception of a piece is raised, a worker
that dies is a `WorkerError`; after either, and after an interruption, no worker is left. Functions, items and results
of `Processes` must be picklable.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from typing import Protocol, Self, TypeVar

from tubecert.leash import follow

T = TypeVar("T")
R = TypeVar("R")
_PATIENCE = 30  # s until a scheduler answers and has a worker
Ready = Callable[[int, R], None] | None


class WorkerError(RuntimeError):
    """A worker process ended in the middle of its work (it was killed, or ran out of memory)."""


class Executor(Protocol):
    """Something that applies a function to items."""

    def map(self, function: Callable[[T], R], items: Sequence[T], ready: Ready[R] = None) -> list[R]:
        """The results, in the order of the items; `ready` is called here with each as it comes, and its place."""
        ...


@dataclass(frozen=True, slots=True)
class Serial:
    """One after the other, in this process."""

    def map(self, function: Callable[[T], R], items: Sequence[T], ready: Ready[R] = None) -> list[R]:
        """The results, in the order of the items."""
        found = []
        for place, item in enumerate(items):
            found.append(function(item))
            if ready is not None:
                ready(place, found[-1])
        return found


@dataclass(frozen=True, slots=True)
class Processes:
    """At the same time, in as many processes as `workers`."""

    workers: int

    def map(self, function: Callable[[T], R], items: Sequence[T], ready: Ready[R] = None) -> list[R]:
        """The results, in the order of the items."""
        with Pool(self.workers) as pool:
            return pool.map(function, items, ready)


class Pool:
    """The same processes for one `map` after another, until the block ends: they start, and import, once.

    After a piece that fails, or a worker that dies, the next `map` begins with new ones.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._pool: ProcessPoolExecutor | None = None
        self._others: set[BaseProcess] = set()  # children that are none of this pool's

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._end()

    def map(self, function: Callable[[T], R], items: Sequence[T], ready: Ready[R] = None) -> list[R]:
        """The results, in the order of the items."""
        pool, done = self._started(), False
        try:
            tasks = [pool.submit(function, item) for item in items]
            if ready is not None:
                places = {task: place for place, task in enumerate(tasks)}
                for task in as_completed(tasks):
                    ready(places[task], task.result())
            found, done = [task.result() for task in tasks], True
            return found
        except BrokenProcessPool:
            message = (
                "a worker ended in the middle of its work: killed, or out of memory; fewer --jobs need less"
            )
            raise WorkerError(message) from None
        finally:
            if not done:
                self._end()

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._others = set(multiprocessing.active_children())
            context = multiprocessing.get_context("spawn")  # a fork would copy the threads of BLAS half-way
            self._pool = ProcessPoolExecutor(
                self.workers, mp_context=context, initializer=_leave_interrupts, initargs=(os.getpid(),)
            )
        return self._pool

    def _end(self) -> None:
        if self._pool is None:
            return
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = None
        for worker in set(multiprocessing.active_children()) - self._others:
            worker.terminate()
            worker.join()


@contextmanager
def held(executor: Executor | None) -> Iterator[Executor | None]:
    """The executor for several `map`s: processes stay until the block ends."""
    if isinstance(executor, Processes):
        with Pool(executor.workers) as pool:
            yield pool
    else:
        yield executor


@dataclass(frozen=True, slots=True)
class Cluster:
    """At the same time, by the workers of a Dask cluster that runs already; needs the extra `cluster`.

    A piece whose worker is lost is given to another one. Workers have the same version of tubecert, and what functions
    name in the file system is there for them.
    """

    address: str

    def map(self, function: Callable[[T], R], items: Sequence[T], ready: Ready[R] = None) -> list[R]:
        """The results, in the order of the items. Raises `WorkerError` where the cluster cannot do it."""
        from distributed import Client, as_completed
        from distributed.scheduler import KilledWorker

        try:
            with Client(self.address, timeout=_PATIENCE, set_as_default=False) as client:
                client.wait_for_workers(1, timeout=_PATIENCE)
                tasks = client.map(function, items, pure=False)
                places = {task.key: place for place, task in enumerate(tasks)}
                for task in as_completed(tasks, loop=client.loop):
                    result = task.result()
                    if ready is not None:
                        ready(places[task.key], result)
                found: list[R] = client.gather(tasks)
                return found
        except KilledWorker as error:
            message = (
                f"workers of {self.address} were lost again and again at the same piece of work: {error}"
            )
            raise WorkerError(message) from None
        except (OSError, TimeoutError) as error:
            raise WorkerError(f"no cluster with workers at {self.address}: {error}") from None

    def versions(self, function: Callable[[], R]) -> list[R]:
        """What a function says on each worker. Raises `WorkerError`."""
        from distributed import Client

        try:
            with Client(self.address, timeout=_PATIENCE, set_as_default=False) as client:
                client.wait_for_workers(1, timeout=_PATIENCE)
                return list(client.run(function).values())
        except (OSError, TimeoutError) as error:
            raise WorkerError(f"no cluster with workers at {self.address}: {error}") from None


def chosen(workers: int, pieces: int) -> Executor:
    """Processes where they help: no more of them than pieces of work."""
    return Processes(min(workers, pieces)) if min(workers, pieces) > 1 else Serial()


def _leave_interrupts(parent: int) -> None:
    """An interruption is dealt with by the command, not by each of its workers; none outlives it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    follow(parent)
