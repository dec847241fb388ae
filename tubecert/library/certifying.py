"""Certification from code, and for the command: a question in, a sealed certificate out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import asking
from tubecert.asking import Number
from tubecert.errors import ExitCode, TubecertError
from tubecert.executor import held
from tubecert.findings import Finding
from tubecert.letters import ALL, words_of
from tubecert.libraries import versions
from tubecert.library.specification import Specifiable, Specification, require_once, settings_in, spec_of
from tubecert.library.workers import workers_of
from tubecert.progress import Progress
from tubecert.report.progress import timed

if TYPE_CHECKING:
    from tubecert.library.certification import Certification
    from tubecert.library.metrics import MetricLike
    from tubecert.library.sampled import SampledCertification

BUDGET: Final = asking.Exact("Boxes examined per claim before giving up.", whole=True, of=asking.METRIC)
DEADLINE: Final = asking.Seconds(
    "Seconds after which the command ends, with the best metric that was found so far.", of=asking.SEARCH
)
SCHEDULER: Final = asking.Text(
    "Work on a running Dask cluster (extra: tubecert[cluster]).", "ADDRESS", of=asking.SEARCH
)
METRIC_NAME: Final = asking.Text(
    "Metric file (JSON) in place of the specification's.", "FILE", sets="metric", of=asking.METRIC
)
DECIDING: Final = (*words_of(), ALL)
AUTO: Final = "auto"  # the gap of each constant by its effect
_OF_SEARCH: Final = Fraction(1, 2)  # of the time: the certification with the metric has the rest
PAIR: Final = ("bandwidth", "adaptation_rate")
_GAP: Final = (
    "Relative width at which a constant is sharp enough; auto: of each by its effect on the gains.  "
    "[tube.gap; else auto for half-widths of four or more states or along a plan that moves, 1/100 elsewhere]"
)


@asking.question({
    "rho_a": asking.Exact(
        "Radius left to the adaptation, a length over all states (overrides tube.rho_a).",
        sets="tube.rho_a", of=asking.METRIC,
    ),
    "epsilon": asking.Exact(
        "Radius beyond the initial offset (overrides tube.epsilon; not beside half_widths).",
        sets="tube.epsilon", of=asking.METRIC,
    ),
    "metric": asking.Kind(METRIC_NAME.help, "FILE", sets="metric", of=asking.METRIC),
    "conditions": asking.Choice(
        "Which certificate decides the verdict: 0 (none: no adaptation), A (26: the paper's), B (distance), "
        "or all of them; all are always computed.  [conditions.decides, or A]",
        words=DECIDING, of=asking.METRIC,
    ),
    "bandwidth": asking.Exact("Judge this filter bandwidth, in rad/s.", moderate=True, of=asking.METRIC),
    "adaptation_rate": asking.Exact("... with this adaptation rate.", moderate=True, of=asking.METRIC),
    "gap": asking.Exact(_GAP, "NUMBER|auto", below=1, word=AUTO, of=asking.METRIC),
    "budget": BUDGET,
    "deadline": replace(DEADLINE, ends=True),
    "jobs": asking.Exact(
        "Processes that share the boxes of a long search (none with hardware).", whole=True, of=asking.SEARCH
    ),
    "scheduler": SCHEDULER,
}, PAIR)  # fmt: skip
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
    `synth` found. `conditions`: the letter of the certificate that decides the verdict, or `all`. `progress` is
    called with every `Step` that is told. Numbers are exact; a float stands for its shortest decimal. The boxes of a
    long search are shared by `jobs` processes (then the caller's own code stands below `if __name__ == "__main__":`),
    or by the workers of a Dask cluster at the address `scheduler`; no result depends on that.

    Returns the certificate whatever the verdict is. Raises `SpecError` for what makes the question meaningless, and
    `TubecertError` once `deadline` s have passed: half of them are for a metric that is looked for.
    """
    from tubecert.library import sampled

    whole = spec_of(spec)
    if whole.hardware is not None:
        asking.require_nothing_of_a_metric()
        return sampled.certified(whole, timed(progress))
    from tubecert import certificate, pipeline
    from tubecert.library.certification import certification_of
    from tubecert.library.metrics import with_metric
    from tubecert.stages.question import Options, overridden

    require_once(settings_in(whole))
    whole, file = (whole, None) if metric is None else with_metric(whole, metric)
    usual = Options()
    options = Options(
        rho_a=asking.exact(rho_a),
        epsilon=asking.exact(epsilon),
        metric=None if file is None else Path(file),
        conditions=conditions,
        bandwidth=asking.exact(bandwidth),
        adaptation_rate=asking.exact(adaptation_rate),
        by_effect=None if gap is None else gap == AUTO,
        gap=asking.exact(None if gap == AUTO else gap) or usual.gap,
        budget=budget or usual.budget,
    )
    run = ran("tubecert.certify")
    seconds = asking.exact(deadline)
    looking = pipeline.Deadline.after(None if seconds is None else seconds * _OF_SEARCH)
    listeners = pipeline.Listeners(kept=asking.hears(progress, "kept"), deadline=looking)
    told = timed(progress)
    if seconds is not None:
        told = pipeline.Listeners(progress=told, deadline=pipeline.Deadline.after(seconds))
    with held(workers_of(jobs, scheduler)) as workers:
        try:
            result = pipeline.certify(whole, options, told, listeners=listeners, workers=workers)
        except pipeline.OutOfTime:
            raise _too_late() from None
    sealed = certificate.seal(result.to_json(), run())
    return certification_of(sealed, Specification(spec=overridden(whole, options)))


def _too_late() -> TubecertError:
    """The error where the time is up before anything is decided."""
    help = "more time, a wider gap, or a smaller safe set or tube"
    finding = Finding(code="TC112", message="undecided: the deadline has passed", help=help)
    return TubecertError([finding], ExitCode.UNDECIDED)


def ran(function: str) -> Callable[[], Mapping[str, object]]:
    """What is noted of a run that begins now, once it is over: command line, beginning, seconds, versions."""
    started, clock = datetime.now(UTC), time.perf_counter()
    return lambda: {
        "command": asking.asker().command or function,
        "started": started.isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - clock, 3),
        "versions": versions(),
    }
