"""What is asked of a command or a function, beside the specification: numbers and words, checked in one place.

In: texts, and what findings call each (`--rho-a` in a command, `rho_a` in code). Out: exact values that go together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, Never, TypeAlias, TypeVar

from tubecert.errors import SpecError
from tubecert.expression import suggestion
from tubecert.findings import Finding, NamedPlace
from tubecert.library.numbers import Numbers
from tubecert.spec import Setting, Spec, Synthesis
from tubecert.spec.metric import MAX_DEGREE, solver_name

if TYPE_CHECKING:
    from tubecert.stages.options import Options

T = TypeVar("T", bound=str)
V = TypeVar("V", int, Fraction)
_SETS: Final = {
    "rho_a": "tube.rho_a",
    "epsilon": "tube.epsilon",
    "metric": "metric",
}  # options by the keys they set
_OF_A_METRIC: Final = (
    "rho_a", "epsilon", "metric", "conditions", "bandwidth", "adaptation_rate", "gap", "budget", "deadline",
    "jobs", "scheduler", "controllers", "gains", "replay", "members", "plan",
)  # fmt: skip
_OF_SEARCHES: Final = ("deadline", "jobs", "scheduler")
Named: TypeAlias = Callable[[str], str]
_BUDGET: Final = 2_000_000  # of a verification
_GAP: Final = Fraction(1, 1000)
AUTO: Final = "auto"  # the gap of each constant by its effect


@dataclass(frozen=True, slots=True, kw_only=True)
class CertificationNumbers:
    """The numbers that a certification may be asked with, exact; None: what the specification, or a default, says."""

    rho_a: Fraction | None
    epsilon: Fraction | None
    deadline: Fraction | None
    bandwidth: Fraction | None
    adaptation_rate: Fraction | None
    gap: Fraction | None
    by_effect: bool | None
    budget: int | None

    def options(self, *, conditions: str | None, metric: Path | None = None) -> Options:
        """The question, with words and a metric beside the numbers."""
        from tubecert.stages.options import Options

        usual = Options()
        return Options(
            rho_a=self.rho_a,
            epsilon=self.epsilon,
            bandwidth=self.bandwidth,
            adaptation_rate=self.adaptation_rate,
            gap=self.gap or usual.gap,
            by_effect=self.by_effect,
            budget=self.budget or usual.budget,
            conditions=conditions,
            metric=metric,
        )


def certification_numbers(given: Mapping[str, str | None], named: Named) -> CertificationNumbers:
    """The numbers of a certification; `named` is what findings call each.

    Raises `SpecError` with everything that is wrong with them.
    """
    numbers = Numbers()
    radii = {name: numbers.positive(named(name), given[name]) for name in ("rho_a", "epsilon", "deadline")}
    gains = {name: numbers.gain(named(name), given[name]) for name in ("bandwidth", "adaptation_rate")}
    text = given["gap"]
    gap = None if text == AUTO else numbers.positive(named("gap"), text, below=1, word=AUTO)
    budget = numbers.count(named("budget"), given["budget"])
    numbers.check()
    by_effect = None if text is None else text == AUTO
    return CertificationNumbers(**radii, **gains, gap=gap, by_effect=by_effect, budget=budget)


def effort_numbers(given: Mapping[str, str | None]) -> CertificationNumbers:
    """The same where gap and budget are all that is asked with; raises `SpecError`."""
    names = ("rho_a", "epsilon", "deadline", "bandwidth", "adaptation_rate", "gap", "budget")
    return certification_numbers({**dict.fromkeys(names), **given}, str)


def require_nothing_of_a_metric(given: Mapping[str, object], named: Named) -> None:
    """Raises `SpecError` for every argument that means nothing where a specification has `hardware`."""
    findings = [
        Finding(
            code="TC112",
            message=f"{named(name)} is about {what}; the sampled loop is proven without",
            location=NamedPlace(file=named(name), line=1, column=1),
            help=f"leave {named(name)} out, or leave hardware out of the specification",
        )
        for name in _OF_A_METRIC
        for what in ("a long search" if name in _OF_SEARCHES else "a certificate with a metric",)
        if given.get(name) is not None
    ]
    if findings:
        raise SpecError(findings)


def jobs_of(name: str, given: str | None) -> int | None:
    """How many processes are asked for; raises `SpecError`."""
    numbers = Numbers()
    found = numbers.count(name, given)
    numbers.check()
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class VerificationNumbers:
    """The numbers that a verification may be asked with, exact."""

    rate: Fraction | None
    gap: Fraction
    budget: int


def verification_numbers(given: Mapping[str, str | None], named: Named) -> VerificationNumbers:
    """The numbers of a verification; raises `SpecError` with everything that is wrong with them."""
    numbers = Numbers()
    rate = numbers.positive(named("rate"), given["rate"])
    gap = numbers.positive(named("gap"), given["gap"], below=1)
    budget = numbers.count(named("budget"), given["budget"])
    numbers.check()
    return VerificationNumbers(rate=rate, gap=gap or _GAP, budget=budget or _BUDGET)


def set_twice(settings: Iterable[Setting], given: Mapping[str, object], named: Named) -> list[Finding]:
    """What is set by its key and by an option, too."""
    return [
        _twice(setting, named(name), key)
        for setting in settings
        for name, key in _SETS.items()
        if given.get(name) is not None and setting.meets(key)
    ]


def require_once(spec: Spec, given: Mapping[str, object]) -> None:
    """Raises `SpecError` for an argument that says what a key says that was set in the specification."""
    settings = [Setting(path=path, text=text) for path, text in spec.settings]
    if twice := set_twice(settings, given, str):
        raise SpecError(twice)


def _twice(setting: Setting, option: str, key: str) -> Finding:
    place = NamedPlace(file=setting.place, line=1, column=1, source=str(setting), width=len(setting.path))
    message = f"{option} is given, too, and says what {key} is"
    return Finding(code="TC104", message=message, location=place, help="keep one of them")


def at_rate(spec: Spec, rate: Fraction | None) -> Spec:
    """The specification with another rate of its metric, if one is given; raises `SpecError` if it has no metric."""
    if spec.metric is None:
        place = NamedPlace(file=spec.path, line=1, column=1)
        help = "give metric.dual_metric and metric.rate, or a metric beside the specification"
        message = "there is no metric to verify"
        raise SpecError([Finding(code="TC105", message=message, location=place, help=help)])
    return spec if rate is None else replace(spec, metric=replace(spec.metric, rate=rate))


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisNumbers:
    """The numbers that a synthesis may be asked with, exact."""

    rate: Fraction | None
    condition_number: Fraction | None
    rho_a: Fraction | None
    epsilon: Fraction | None
    deadline: Fraction | None
    budget: int | None


def synthesis_numbers(given: Mapping[str, str | None], named: Named) -> SynthesisNumbers:
    """The numbers of a synthesis; raises `SpecError` with everything that is wrong with them."""
    numbers = Numbers()
    names = ("rate", "condition_number", "rho_a", "epsilon", "deadline")
    values = {name: numbers.positive(named(name), given[name]) for name in names}
    budget = numbers.count(named("budget"), given["budget"])
    numbers.check()
    return SynthesisNumbers(**values, budget=budget)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What is asked of a metric beside the specification's own section; None: what that says."""

    rate: Fraction | None
    objective: str | None
    degree: int | None
    variables: tuple[str, ...] | None
    condition_number: Fraction | None
    coordinates: Literal["auto", "identity"] | None
    route: str | None
    solver: str | None


def wanted_of(system: Spec, wishes: Wishes, named: Named) -> Synthesis:
    """What is asked for: the specification's section, changed by wishes; `named` is what findings call each.

    Without a section the rate is that of the specification's own metric. Raises `SpecError` if they do not go together.
    """
    own = system.synthesis
    if own is None:
        rate = None if system.metric is None else system.metric.rate
        own = Synthesis(rate=rate, objective="adaptation" if rate is None else "condition")
    objective, rate = wishes.objective or own.objective, _rather(wishes.rate, own.rate)
    if objective == "rate" or (
        objective in ("adaptation", "tube") and wishes.rate is None and own.objective != objective
    ):
        rate = None  # searched for
    elif wishes.rate is not None and wishes.objective is None and own.rate is None:
        objective = "condition"
    variables, solver = wishes.variables, wishes.solver
    wanted = Synthesis(
        rate=rate,
        objective=objective,
        degree=_rather(wishes.degree, own.degree),
        variables=own.variables if variables is None else _known_states(system, variables, named),
        condition_number=_rather(wishes.condition_number, own.condition_number),
        coordinates=wishes.coordinates or own.coordinates,
        route=wishes.route or own.route,
        solver=own.solver if solver is None else _solver(solver, named),
        outputs=own.outputs if objective == "tube" else (),
    )
    if wanted.objective == "rate" and wishes.rate is not None:
        text = f"the objective rate searches for the rate; {named('rate')} cannot be given"
        refuse(named("objective"), "rate", text)
    if wanted.objective in ("condition", "margin") and wanted.rate is None:
        text = f"the objective {wanted.objective} needs {named('rate')}, in 1/s"
        refuse(named("objective"), wanted.objective, text)
    return wanted


def _rather(wish: V | None, own: V | None) -> V | None:
    return own if wish is None else wish


def _solver(text: str, named: Named) -> str:
    found = solver_name(text)
    if found is None:
        known = "the solvers are clarabel, scs, and cvxpy:NAME for those that cvxpy knows"
        refuse(named("solver"), text, known)
    return found


def _known_states(system: Spec, names: tuple[str, ...], named: Named) -> tuple[str, ...]:
    for name in names:
        if name not in system.states:
            known = f"{name} is no state; the states are {', '.join(system.states)}"
            refuse(named("variables"), ",".join(names), known)
    return names


def degree_of(degree: int | None) -> int | None:
    """The degree, if it is one that W can have; raises `SpecError`."""
    if degree is not None and not 0 <= degree <= MAX_DEGREE:
        refuse("degree", str(degree), f"the degree is between 0 and {MAX_DEGREE}")
    return degree


def one_of(name: str, word: str | None, known: Sequence[T]) -> T | None:
    """The word, if it is one of those known, or None; raises `SpecError`."""
    if word is None:
        return None
    found = next((each for each in known if each == word), None)
    if found is None:
        refuse(name, word, f"{name} is {word[:60]!r}; {suggestion(word, known, what='choices')}")
    return found


def refuse(name: str, text: str, message: str) -> Never:
    """Raises the `SpecError` about the value of an option or an argument."""
    place = NamedPlace(file=name, line=1, column=1, source=text, width=len(text))
    raise SpecError([Finding(code="TC112", message=message, location=place)])
