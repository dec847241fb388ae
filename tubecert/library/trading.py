"""What a tube asks of a machine: the settings that ask for it, from words and from values.

In: a specification that can be read with other settings. Out: the settings of a tube, and of a machine whose one part
is the largest; what may be traded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final

from tubecert.claims.advice import HardwarePart
from tubecert.digits import near
from tubecert.errors import SpecError
from tubecert.expression import number_text
from tubecert.findings import Finding
from tubecert.library.asked import Named
from tubecert.library.numbers import Numbers
from tubecert.pipeline.sensitivities import Better, Part
from tubecert.printable import visible
from tubecert.records import Json
from tubecert.spec.canonical import hardware_data
from tubecert.spec.hardware import LARGEST
from tubecert.spec.override import Setting
from tubecert.spec.types import Hardware

if TYPE_CHECKING:
    from tubecert.pipeline import Deadline, Options
    from tubecert.pipeline.width import Measure
    from tubecert.progress import Progress
    from tubecert.spec import Spec

CORRIDOR: Final = "corridor"
PARETO: Final = "pareto"
SENSITIVITIES: Final = "sensitivities"
QUANTITIES: Final[Mapping[str, HardwarePart]] = {
    "hardware.rate": "sample_time",
    "hardware.delay": "delay",
    "hardware.noise": "noise",
    "disturbance.bound": "wind",
}
TUBE: Final = "tube"


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A design: `load` reads the specification with settings beside its own; `named` is what findings call options.

    At the `deadline` it comes out with the best that was certified by then.
    """

    load: Callable[[Sequence[Setting]], Spec]
    options: Options
    measure: Measure
    progress: Progress | None
    named: Named
    deadline: Deadline | None = None


def refused(option: str, message: str, help: str) -> SpecError:
    """What is wrong with an option."""
    return SpecError([Finding(code="TC122", message=f"{option}: {message}", help=help)])


def quantities(words: str, named: Named) -> tuple[str, HardwarePart]:
    """The number of the machine that is traded for the tube; raises `SpecError`."""
    names = [word.strip() for word in words.split(",")]
    others = [name for name in names if name != TUBE]
    if len(names) != 2 or len(others) != 1 or others[0] not in QUANTITIES:
        known = ", ".join(QUANTITIES)
        raise refused(
            named(PARETO), f"{visible(words)} is no pair of quantities", f"write tube and one of {known}"
        )
    return others[0], QUANTITIES[others[0]]


def parts_of(spec: Spec, named: Named) -> list[HardwarePart]:
    """The parts of a machine that can be the largest, each alone; raises `SpecError` without a machine."""
    own, wind = spec.hardware, spec.disturbance
    if own is None:
        raise refused(named(CORRIDOR), "the specification has no hardware", "write hardware: {rate: 500}")
    if own.largest is not None:
        help = "give every number of the machine"
        raise refused(named(CORRIDOR), f"the {own.largest} is already to be the largest", help)
    parts: list[HardwarePart] = ["sample_time", "delay"]
    if not isinstance(own.noise, tuple):
        parts.append("noise")
    if wind is not None and wind.rate is None:
        parts.append("wind")
    return parts


def largest(spec: Spec, part: HardwarePart) -> list[Setting]:
    """The settings that ask for the largest value of a part, the rest of the machine being as it is."""
    own = spec.hardware
    if part == "wind" or own is None:
        return [Setting(path="disturbance.bound", text=LARGEST)]
    if part == "sample_time":
        return _machine(spec, replace(own, sample_time=None, largest=part))
    if part == "delay":
        return _machine(spec, replace(own, delay=None, one_sample=False, largest=part))
    return _machine(spec, replace(own, noise=None, largest=part))


def _machine(spec: Spec, own: Hardware, limits: Fraction = Fraction(1)) -> list[Setting]:
    """A whole machine; limits of inputs, which may stand in its section, in their own, so many times as wide."""
    found = [Setting(path="hardware", text=_flow(hardware_data(spec, own)))]
    return [*found, _limits(spec, limits)] if spec.limits else found


def _limits(spec: Spec, factor: Fraction) -> Setting:
    """The limits of the inputs, so many times as wide about their middles."""
    ends = {}
    for name, (low, high) in spec.limits:
        middle, half = (low + high) / 2, (high - low) / 2 * factor
        ends[name] = f"[{number_text(middle - half)}, {number_text(middle + half)}]"
    return Setting(path="limits", text=_flow(ends))


def better_machines(spec: Spec, named: Named) -> list[Better]:
    """The machine with each of its numbers halved, and taken away; raises `SpecError` without a machine.

    Of the sample time a hundredth is left, or the delay, which it cannot be below. Limits are doubled, and a thousand
    times as wide.
    """
    own, wind, found = spec.hardware, spec.disturbance, []
    if own is None or own.largest is not None or (wind is not None and wind.bound is None):
        help = "give every number of the machine"
        raise refused(named(SENSITIVITIES), "the machine is not given by numbers", help)

    def add(part: Part, settings: Callable[[Fraction], list[Setting]], least: Fraction = Fraction(0)) -> None:
        for gone, factor in ((False, Fraction(1, 2)), (True, least)):
            found.append(Better(part=part, gone=gone, settings=tuple(settings(factor))))

    Ts, delay, noise = own.sample_time, own.delay, own.noise
    if Ts is not None:
        least = max(Ts / 100, delay or Fraction(0)) / Ts
        add("sample_time", lambda k: _machine(spec, replace(own, sample_time=Ts * k)), least)
        now = Ts if delay is None else delay
        if now:
            add("delay", lambda k: _machine(spec, replace(own, delay=now * k, one_sample=False)))
    if isinstance(noise, tuple):
        add("noise", lambda k: _machine(spec, replace(own, noise=tuple(size * k for size in noise))))
    elif noise:
        add("noise", lambda k: _machine(spec, replace(own, noise=noise * k)))
    if wind is not None and wind.bound:
        bound = wind.bound
        add("wind", lambda k: [Setting(path="disturbance.bound", text=number_text(bound * k))])
    if spec.limits:
        add("limits", lambda k: _machine(spec, own, 1 / k), Fraction(1, 1000))
    return found


def corridor_settings(words: str, asked: Asked) -> list[Setting]:
    """The tube that is asked for: half-widths by state, or the radius; raises `SpecError`."""
    if "=" in words:
        pairs = [each.partition("=")[::2] for each in words.split(",")]
        if not all(name.strip() and value.strip() for name, value in pairs):
            raise refused(
                asked.named(CORRIDOR), f"{visible(words)} is no list STATE=WIDTH", "write px=0.2,pz=0.2"
            )
        widths = {name.strip(): value.strip() for name, value in pairs}
        return [Setting(path=TUBE, text=_flow({"half_widths": widths}), option=asked.named(CORRIDOR))]
    numbers = Numbers()
    radius = numbers.positive(asked.named(CORRIDOR), words)
    if radius is None:
        raise SpecError(numbers.findings)
    return _radius_settings(radius, asked)


def _radius_settings(radius: Fraction, asked: Asked) -> list[Setting]:
    """`epsilon` and `rho_a` in proportion, so that the tube has a radius."""
    from tubecert.conditions.decimals import round_down
    from tubecert.pipeline import certify

    spec = asked.load([])
    if spec.tube.auto or spec.tube.epsilon is None or spec.tube.rho_a is None:
        help = f"name half-widths: {asked.named(CORRIDOR)} {spec.states[0]}=0.2"
        raise refused(
            asked.named(CORRIDOR), "a radius belongs to a tube with epsilon and rho_a, a ball", help
        )
    tube = certify(spec, asked.options, asked.progress).tube
    own = spec.tube.epsilon + spec.tube.rho_a
    start = Fraction(0) if tube is None else tube.rho - own
    if start >= radius:
        help = f"the start alone takes {near(start, 4)}: ask for more"
        raise refused(asked.named(CORRIDOR), f"no tube has the radius {number_text(radius)}", help)
    share = (radius - start) / own
    keys = {"epsilon": spec.tube.epsilon, "rho_a": spec.tube.rho_a}
    return [
        Setting(
            path=f"tube.{key}",
            text=number_text(round_down(float(value * share), 8)),
            option=asked.named(CORRIDOR),
        )
        for key, value in keys.items()
    ]


def _flow(value: Json) -> str:
    """Data as it stands in a line of YAML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(each)}" for key, each in value.items()) + "}"
    return str(value)
