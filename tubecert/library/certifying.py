"""Certification from code, and what the command shares with it: a question in, a sealed certificate out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert import certificate
from tubecert.executor import Executor, held
from tubecert.letters import ALL, words_of
from tubecert.libraries import versions
from tubecert.library.asked import (
    CertificationNumbers,
    certification_numbers,
    jobs_of,
    one_of,
    refuse,
    require_nothing_of_a_metric,
    require_once,
)
from tubecert.library.plain import Number, number_texts
from tubecert.library.specification import Specifiable, Specification, spec_of
from tubecert.library.workers import workers_of
from tubecert.progress import Progress
from tubecert.report.progress import timed
from tubecert.spec import Spec

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.metrics import MetricLike
    from tubecert.library.sampled import SampledCertification
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.stages.options import Options


def certify(
    spec: Specifiable,
    *,
    rho_a: Number | None = None,
    epsilon: Number | None = None,
    metric: MetricLike | None = None,
    conditions: str | None = None,
    bandwidth: Number | None = None,
    adaptation_rate: Number | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    deadline: Number | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Certification | SampledCertification:
    """Prove the tube around the plan and find the smallest gains: `tubecert certify`, with the same options.

    A specification with `hardware` is about the sampled loop: then the controller that is proven is found as well, and
    of the options only `progress` means something.

    `metric` stands in for the specification's own: a file, a mapping with `rate` and `dual_metric`, or what
    `synthesise` found. `conditions`: the letter of the certificate that decides the verdict, or `all`. `progress` is
    called with every `Step` that is told. Numbers are exact; a float stands for its shortest decimal. The boxes of a
    long search are shared by `jobs` processes (then the caller's own code stands below `if __name__ == "__main__":`),
    or by the workers of a Dask cluster at the address `scheduler`; no result depends on that.

    Returns the certificate whatever the verdict is. Raises `SpecError` for what makes the question meaningless.
    """
    texts = number_texts(
        rho_a=rho_a,
        epsilon=epsilon,
        bandwidth=bandwidth,
        adaptation_rate=adaptation_rate,
        gap=gap,
        budget=budget,
        deadline=deadline,
    )
    numbers = certification_numbers(texts, str)
    _check_words(conditions, numbers)
    whole = spec_of(spec)
    if whole.hardware is not None:
        words = {"metric": metric, "conditions": conditions, "scheduler": scheduler}
        require_nothing_of_a_metric({**texts, **words, "jobs": None if jobs == 1 else jobs}, str)
        from tubecert.library import sampled

        return sampled.certified(whole, progress=timed(progress), command="tubecert.certify")
    require_once(whole, {**texts, "metric": metric})
    options = numbers.options(conditions=conditions)
    if metric is not None:
        from tubecert.library.metrics import with_metric

        whole, name = with_metric(whole, metric)
        options = replace(options, metric=Path(name))
    return certified(
        whole,
        options,
        timed(progress),
        seconds=numbers.deadline,
        command="tubecert.certify",
        workers=workers_of(jobs_of("jobs", str(jobs)), scheduler, "scheduler"),
    )


def certified(
    spec: Spec,
    options: Options,
    progress: Progress | None,
    *,
    seconds: Fraction | None,
    command: str,
    kept: Callable[[Synthesised], None] | None = None,
    workers: Executor | None = None,
) -> Certification:
    """The sealed answer to a question; `command` is noted as its origin, `seconds` ends the search for a metric.

    `kept` hears what a search for a metric has; `workers` share long searches.
    """
    from tubecert import pipeline
    from tubecert.library.certification import certification_of
    from tubecert.stages.options import overridden

    run = ran(command)
    deadline = None if seconds is None else pipeline.Deadline.after(float(seconds))
    with held(workers) as helpers:
        result = pipeline.certify(spec, options, progress, deadline=deadline, kept=kept, workers=helpers)
    sealed = certificate.seal(result.to_json(), run())
    return certification_of(sealed, Specification(spec=overridden(spec, options)))


def ran(command: str) -> Callable[[], Mapping[str, object]]:
    """What is noted of a run that begins now, once it is over: command line, beginning, seconds, versions."""
    started, clock = datetime.now(UTC), time.perf_counter()
    return lambda: {
        "command": command,
        "started": started.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - clock, 3),
        "versions": versions(),
    }


def _check_words(conditions: str | None, numbers: CertificationNumbers) -> None:
    """Raises `SpecError` for words that mean nothing, and for half of a pair of gains."""
    one_of("conditions", conditions, (*words_of(), ALL))
    bandwidth, rate = numbers.bandwidth, numbers.adaptation_rate
    if bandwidth is not None and rate is None:
        refuse("bandwidth", str(bandwidth), "bandwidth and adaptation_rate are given together")
    if rate is not None and bandwidth is None:
        refuse("adaptation_rate", str(rate), "adaptation_rate and bandwidth are given together")
