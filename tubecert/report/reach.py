"""How far states and inputs go: the tube, its shape, what it keeps clear of, the ranges of the inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

from tubecert.certificate.result import InputData, Result, TubeData
from tubecert.digits import UNKNOWN, down, end, near, percent, short, up
from tubecert.report.gains import NAMES
from tubecert.trajectory.hermite import ends_of_pieces
from tubecert.verdict import Verdict

_NOTABLE = 0.01  # of the range of the knots
_NARROWER = 0.97  # of what was asked for
_MANY = 10  # times its limits: no per cent
_AT_THE_EDGE = 0.9  # of the room in the safe set


def asked_for(result: Result, found: Mapping[str, float]) -> Iterator[str]:
    """Where half-widths are narrower than asked for: what was asked, and which state limits the tube."""
    asked = {name: float(most) for name, most in result.spec.effective.tube.half_widths.items()}
    narrower = {name: most for name, most in asked.items() if found.get(name, most) < _NARROWER * most}
    if not narrower:
        return
    attained = [name for name in asked if name not in narrower and name in found]
    why = f"; {attained[0]} limits the tube, with the half-width that is asked for" if attained else ""
    if not attained and (stopped := _stopped(result, found)) is not None:
        why = f"; {stopped} limits the tube: it goes nearly to the edge of the safe set"
    yield f"at most {half_widths(result, narrower)}{why}"


def _stopped(result: Result, found: Mapping[str, float]) -> str | None:
    """The state that is nearest to the edge of the safe set, if it is there, by the points the plan is drawn by."""
    drawn, names = result.plan.samples, result.spec.effective.system.states
    if drawn is None:
        return None
    used = {}
    for name, curve in zip(names, zip(*drawn.x, strict=True), strict=True):
        low, high = map(float, result.safe_set[name])
        room = min(min(curve) - low, high - max(curve))
        used[name] = found[name] / room if room > 0 and name in found else 0.0
    nearest = max(names, key=lambda name: used[name])
    return nearest if used[nearest] > _AT_THE_EDGE else None


def excursion(result: Result) -> Iterator[str]:
    """How far the plan leaves the range of its knots, where that is worth a word; by the points it is drawn by."""
    knots, drawn = result.plan.exact_knots(), result.plan.samples
    if knots is None or drawn is None:
        return
    for name, own, curve in zip(
        result.spec.effective.system.states,
        zip(*ends_of_pieces(knots).x, strict=True),
        zip(*drawn.x, strict=True),
        strict=True,
    ):
        low, high = float(min(own)), float(max(own))
        beyond = max(low - min(curve), max(curve) - high)
        if beyond > _NOTABLE * (high - low):
            span = f"[{near(low, 4)}, {near(high, 4)}]"
            yield f"between its knots the plan takes {name} {near(beyond, 3)} beyond all of them, which are in {span}"


def is_radius(result: Result) -> bool:
    """Whether the radius of the tube is a length in the states."""
    return result.tube is None or result.tube.coordinates is None


def extent(result: Result) -> str:
    """How far the state may be from the plan: the radius, or the half-widths of a tube measured by the metric."""
    tube = result.tube
    if is_radius(result) or tube is None or tube.half_widths is None:
        return f"{up(None if tube is None else tube.rho)} {_unit(result)}".rstrip()
    return f"the half-widths {half_widths(result, tube.half_widths)}"


def _unit(result: Result) -> str:
    """The unit of a length over all states, if they have one."""
    system = result.spec.effective.system
    units = {system.units.get(name, "") for name in system.states}
    return units.pop() if len(units) == 1 else ""


def in_states(result: Result, tube: TubeData, length: Fraction, name: str) -> str:
    """What a share of dbar is in each state: a distance within it keeps |x_i - x_i*| within that share."""
    share = float(length / tube.rho)
    widths = half_widths(result, {name: share * width for name, width in (tube.half_widths or {}).items()})
    return f"{name} is {percent(share)} of the tube: by state at most {widths}"


def clearances(result: Result) -> Iterator[str]:
    """How far the tube keeps from each obstacle."""
    for number, (obstacle, own) in enumerate(
        zip(result.spec.effective.obstacles, result.clearance, strict=False), start=1
    ):
        where = f"obstacle {number} ({', '.join(obstacle.states)})"
        when = "" if own.t is None else f"; nearest at t = {short(own.t, 4)} s"
        if own.verdict is Verdict.CERTIFIED:
            yield f"clear of {where} by at least {down(own.clearance.below)}{when}"
        else:
            told = "the tube meets it" if own.verdict is Verdict.REFUTED else "the tube may meet it"
            yield f"{where}: {told}{when}" + ("" if own.decides else " (does not decide)")


def input_lines(result: Result, own: InputData) -> Iterator[str]:
    """How far an input with limits goes in the loop of every kind that decides; a table says what takes it there."""
    unit = result.spec.effective.system.units.get(own.input, "")
    limits = f"of {ends_of(own.limits)}"
    told = [key for key in result.decided_by if key in own.bounds]
    for key in told:
        stays = "stays within" if own.verdict is Verdict.CERTIFIED else "is proven to stay within"
        span = span_of(own.bounds[key].least, own.bounds[key].greatest)
        where = f" with {NAMES[key]}" if len(told) > 1 else ""
        yield f"{stays} {span} {unit}".rstrip() + f"{where} {limits}: {used(own, key)} used"
    if not told:
        plan = span_of(own.plan.least.below, own.plan.greatest.above)
        yield f"is in {plan} {limits} on the plan; nothing is proven of it in the loop"
    if own.verdict is Verdict.REFUTED:
        yield "leaves its limits on the plan itself"


def ends_of(limits: tuple[Fraction, Fraction]) -> str:
    """A range as it is declared."""
    return f"[{end(limits[0])}, {end(limits[1])}]"


def span_of(low: float, high: float) -> str:
    """A range that contains this one."""
    return f"[{down(low)}, {up(high)}]"


def used(own: InputData, key: str) -> str:
    """How much of its limits an input uses: 0 % in the middle of them, 100 % at one of them."""
    share = own.use([key])
    if share is None:
        return UNKNOWN
    return f"{up(100 * share, 3)} %" if share < _MANY else f"{up(share, 3)} times what there is"


def radii(tube: TubeData) -> str:
    """The radius and its parts."""
    parts = "" if tube.rho_r is None else f" = {up(tube.rho_r)} (rho_r) + {up(tube.rho_a)} (rho_a)"
    return f"{up(tube.rho)}{parts}"


def half_widths(result: Result, widths: Mapping[str, float], sign: str = "") -> str:
    """The half-width of every state and output, after a `sign`."""
    units = result.spec.effective.system.units
    return ", ".join(
        f"{name} {sign}{up(widths[name])} {units.get(name, '')}".rstrip()
        for name in result.spec.effective.system.lengths
        if name in widths
    )


def long_run(result: Result) -> Iterator[tuple[str, str]]:
    """How near the plan the state is when the initial error has died out, for each certificate that holds."""
    if result.spec.effective.trajectory.horizon is not None:
        return
    for key, words in NAMES.items():
        section = result.sections.get(key)
        held = section is not None and section.verdict is Verdict.CERTIFIED
        if section is not None and held and section.ultimate_radius is not None:
            yield words, _rest(result, section.ultimate_radius)


def _rest(result: Result, ultimate: float) -> str:
    tube = result.tube
    if tube is None or tube.coordinates is None:
        return f"|x - x*| <= {up(ultimate)}"
    return f"|x_i - x_i*| <= {up(100 * ultimate / float(tube.rho), 3)} % of the half-widths"
