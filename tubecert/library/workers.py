"""Who helps: processes of this machine, or the workers of a Dask cluster that would find the very same results."""

from __future__ import annotations

from tubecert.asking import named, require_installed
from tubecert.errors import SpecError
from tubecert.executor import Cluster, Executor, Processes, WorkerError
from tubecert.findings import Finding
from tubecert.libraries import versions
from tubecert.printable import visible


def workers_of(jobs: int | None, scheduler: str | None) -> Executor | None:
    """A cluster by its address, else as many processes as are wanted; None: this process alone.

    Raises `SpecError` as `cluster_at` does.
    """
    if scheduler is not None:
        return cluster_at(scheduler)
    return Processes(jobs) if jobs is not None and jobs > 1 else None


def cluster_at(address: str) -> Cluster:
    """The cluster at an address; raises `SpecError` if there is none, or if its workers could find other results."""
    require_installed("distributed", "cluster", f"{named('scheduler')} needs")
    cluster, own = Cluster(address), versions()
    try:
        others = cluster.versions(versions)
    except WorkerError as error:
        help = "start one: dask scheduler, then dask worker ADDRESS on each machine"
        raise SpecError([Finding(code="TC122", message=visible(str(error)), help=help)]) from None
    other = {name for each in others for name in {*own, *each} if own.get(name) != each.get(name)}
    if other:
        message = f"workers of {visible(address)} have other versions of {', '.join(sorted(other))}"
        help = "what comes out must not depend on who computes it: install the same everywhere"
        raise SpecError([Finding(code="TC122", message=message, help=help)])
    return cluster
