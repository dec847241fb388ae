"""What a certificate of a sampled loop says, in words: what is claimed, what it rests on, what is lacking.

In: the records of the certificate. Out: sentences, which nothing reads again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from fractions import Fraction
from typing import Final

from tubecert.certificate.effective import Effective, SystemView, Tree
from tubecert.digits import end, in_unit, short, up
from tubecert.sampled_loop.record import Lack, Missing, Notes, Result, Shares
from tubecert.verdict import Verdict

NOTHING: Final = 1e-12  # half-widths and deviations below it, in any unit, are of rounding alone
SHARES: Final[Mapping[str, str]] = {
    "noise": "noise",
    "holding": "delay and holding",
    "uncertainty": "h",
    "wind": "wind",
    "start": "start",
    "remainder": "remainder",
}
_HELD: Final = {
    "middle": "in the middle of the interval in which it acts",
    "left": "where the interval begins in which it acts",
}
_WHY: Final[Mapping[Missing, tuple[str, str]]] = {  # and what is added where it is known how much is lacking
    "no_design": ("no controller was found", ": no input moves a mode of {where} that does not die away"),
    "no_fixed_point": (
        "no tube closes: what is not linear widens that of {where} ever more",
        " (else {allowed})",
    ),
    "inputs": ("the input {where} has too little room", ": beside the plan it needs {needed} of {allowed}"),
    "safe_set": ("the tube of {where} leaves the safe set", " by {needed}"),
    "start": ("the start of {where} is too far from the plan", ": {needed} of {allowed}"),
    "plan": ("the plan itself leaves {bounds}", ": {where} goes to {needed}, beyond {allowed}"),
    "obstacle": ("the tube is not proven to keep away from obstacle {where}", ""),
    "undefined": ("the equations are not proven to be defined in the tube: {where}", ""),
    "wish": ("the tube of {where} is wider than wished for", ": {needed} of {allowed}"),
    "not_proven": ("what was found in floats is not proven", ""),
}
_ALONE: Final[Mapping[Missing, tuple[str, str]]] = {  # the same with controller: none
    "no_design": ("without a controller a mode of {where} does not die away", ": it grows by {needed} 1/s"),
    "no_fixed_point": ("without a controller no tube closes: that of {where} widens ever more", ""),
}
_FASTER: Final = "a higher hardware.rate, a shorter hardware.delay, less noise, wind or h, or wider limits"
_AUTO: Final = "controller: auto; without one every mode must die away by itself"
_HELP: Final[Mapping[Missing, str]] = {
    "no_design": "an input or a sensor for that mode of {where}",
    "no_fixed_point": "a nearer start, less noise, wind, delay or h, parameters that are known better, a higher "
    "hardware.rate, or, if the plan moves, one that moves less",
    "inputs": "wider limits, a plan that uses less of them, or less of what asks most: {largest}",
    "safe_set": "a larger safe_set, a plan farther from its sides, or less of what fills the tube",
    "start": "a nearer initial_state, or a larger wish or safe_set",
    "plan": "wider limits or a larger safe_set, or a plan that keeps to them",
    "obstacle": "a plan that passes it farther away, or a wish in tube.half_widths for the states of its plane",
    "undefined": "a smaller safe_set that keeps away from there, or a narrower tube",
    "wish": "a larger wish, or less of what fills the tube most: {largest}",
    "not_proven": "a slightly smaller start, or less noise, wind or h",
}


def promise(result: Result) -> str:
    """What the verdict says, as a sentence without its subject."""
    if result.verdict is Verdict.CERTIFIED:
        return f"the state stays in the tube around {plan(result)} {extent(result)}"
    return "; ".join(why(lack, result.spec.effective) for lack in result.lacks) or "nothing is proven"


def plan(result: Result) -> str:
    """What the tube is around."""
    return "every plan of the family" if result.spec.effective.trajectory.kind == "any" else "the plan"


def misses(fitting: str) -> str:
    """That the plan does not solve its own equations, and what would."""
    moving = "it misses its equations, or does not end at rest: tubecert check"
    return f"it is no equilibrium: {fitting} is" if fitting else moving


def extent(result: Result) -> str:
    """The time that is claimed."""
    claim, last = result.claim, result.spec.effective.trajectory.horizon
    if claim.horizon is not None:
        return f"for 0 <= t <= {short(claim.horizon, 12)} s"
    goes_on = result.spec.effective.trajectory.kind == "expressions"
    after = {
        "rest": "at rest at the end of the plan after",
        "repeat": "along formulas that go on after" if goes_on else "which is repeated every",
    }
    told = after.get(claim.afterwards)
    return "for all t >= 0" + (f", {told} {short(last, 12)} s" if told and last is not None else "")


def lacking(result: Result, notes: Notes) -> list[tuple[str, str, str]]:
    """What lacks: its kind, why, and what would help."""
    own = result.spec.effective
    return [(lack.kind, why(lack, own), remedy(lack, result, notes)) for lack in result.lacks]


def why(lack: Lack, effective: Effective) -> str:
    """Why nothing is certified, with numbers in the unit of what lacks."""
    unit = "" if lack.kind == "no_design" else effective.system.units.get(lack.where, "")
    needed, allowed = (f"{up(number)} {unit}".rstrip() for number in (lack.needed, lack.allowed))
    sentence, more = (_ALONE if is_alone(effective) else _WHY).get(lack.kind, _WHY[lack.kind])
    text = sentence if lack.needed is None else sentence + more
    told = {"where": lack.where, "needed": needed, "allowed": allowed}
    bounds = "the safe set" if lack.where in effective.system.states else "its limits"
    return text.format(**told, bounds=bounds).removesuffix(": ")


def remedy(lack: Lack, result: Result, notes: Notes) -> str:
    """What would help, by what fills the quantity that lacks."""
    if lack.kind in _ALONE and is_alone(result.spec.effective):
        return _AUTO
    filled = notes.filled.get(lack.where)
    most = "" if filled is None else max(SHARES, key=lambda name: float(getattr(filled, name)))
    help = _HELP[lack.kind] if lack.where or lack.kind != "no_design" else _FASTER
    largest = causes(result).get(most, "noise, wind, h, delay or the start")
    return help.format(where=lack.where, largest=largest)


def is_alone(effective: Effective) -> bool:
    """Whether there is to be no controller."""
    return effective.data.get("controller") == "none"


def causes(result: Result) -> Mapping[str, str]:
    """The words of the shares; h, wind of a bounded rate and slow parameters are compensated, and counted, together."""
    own = result.spec.effective
    given, ranges = own.part("uncertainty"), [len(each.ends) for each in own.system.parameters.values()]
    acts = {
        "h": "bounds" in given or any(text != "0" for text in given.get("h", ())),
        "slow wind": "rate" in own.part("disturbance"),
        "parameters": 2 in ranges and (result.recipe is None or result.recipe.parameters == "slow"),
    }
    slow = " and ".join(name for name, found in acts.items() if found)
    return {**SHARES, "uncertainty": slow or SHARES["uncertainty"]}


def percents(shares: Shares, words: Mapping[str, str]) -> dict[str, int]:
    """Whole per cents by `words`, which add up to 100, or to 0; what is nothing is left out."""
    parts = {words[item.name]: float(getattr(shares, item.name)) for item in fields(shares)}
    whole = sum(parts.values())
    if whole < NOTHING:
        return {}
    exact = {name: 100 * part / whole for name, part in parts.items()}
    found = {name: int(part) for name, part in exact.items()}
    for name in sorted(exact, key=lambda name: found[name] - exact[name])[: 100 - sum(found.values())]:
        found[name] += 1
    return {name: part for name, part in found.items() if part}


def filling(shares: Shares, words: Mapping[str, str]) -> str:
    """The same in a row, the largest first."""
    found = percents(shares, words)
    return ", ".join(f"{name} {found[name]} %" for name in sorted(found, key=lambda name: -found[name]))


def loop(effective: Effective) -> str:
    """The computer and the sensors: `500 Hz, delay 0.0005 s, noise p 0.001 m`."""
    own = effective.part("hardware")
    period = float(Fraction(own["sample_time"]))
    rate = f"{short(1 / period, 6)} Hz" if period < 1 else f"every {short(period, 6)} s"
    return f"{rate}, delay {_delay(own['delay'])}, noise {_noise(own['noise'], effective.system)}"


def family(effective: Effective) -> str:
    """Which plans belong to a family."""
    told = effective.part("trajectory")
    sides = [pair for box in ("x", "u") for pair in effective.system.ordered(told.get(box, {})).items()]
    boxes = ", ".join(f"{name}* in [{', '.join(end(Fraction(at)) for at in ends)}]" for name, ends in sides)
    steepest = effective.system.ordered(told.get("input_rate", {})).items()
    rates = [f"|{name}*'| <= {end(Fraction(rate))}" for name, rate in steepest]
    return "; ".join([boxes, *rates, f"|x*' - f(x*) - B(x*) u*| <= {end(Fraction(told.get('defect', '0')))}"])


def assumed(result: Result) -> Iterator[str]:
    """What the claim rests on and does not show."""
    own, claim = result.spec.effective, result.claim
    yield "every state is measured at every sample, with an error within the noise, arbitrary from sample to sample"
    yield "samples and inputs come exactly on time: the delay is the same for all, and nothing is lost"
    if claim.hold in _HELD:
        yield (
            f"the computer holds the plan's input, taken {_HELD[claim.hold]}; before the first command acts, the "
            "actuators hold the plan's input by the same rule, and the controller's own state is 0"
        )
        yield "a planner that changes its plan does so for times later than delay and sample time together"
    else:
        yield "the actuators follow the plan's input continuously; the controller's own state is 0 at the start"
    arithmetic = own.part("hardware").get("arithmetic", "double")
    yield f"the controller computes in {arithmetic} precision as IEEE 754 has it (C: compiled without -ffast-math)"
    if any(len(each.ends) == 2 for each in own.system.parameters.values()):
        yield "a parameter that has a range is constant, anywhere in its range"
    if own.part("uncertainty").get("bounds"):
        yield "the declared bounds of h and of its slopes hold"
    if wind := own.part("disturbance"):
        within = "wind and its rate are within their bounds" if "rate" in wind else "wind is within its bound"
        yield f"the {within}, and otherwise arbitrary"


def _delay(told: str) -> str:
    """A time, or `one sample`."""
    return f"{short(told, 6)} s" if told[:1].isdigit() or told[:1] == "." else told


def _noise(told: Tree, system: SystemView) -> str:
    """One length, or a size for each state."""
    if not isinstance(told, Mapping):
        return "0" if Fraction(told) == 0 else f"{end(Fraction(told))} (length)"
    alike: dict[str, list[str]] = {}
    for name, size in system.ordered(told).items():
        alike.setdefault(in_unit(end(Fraction(size)), system.units.get(name, "")), []).append(name)
    return ", ".join(f"{', '.join(names)} {size}" for size, names in alike.items())
