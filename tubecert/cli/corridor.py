"""`design --corridor` and `--pareto`: what a tube asks of the machine; each answer is a certificate on disk."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import certificate
from tubecert.claims.advice import HardwarePart
from tubecert.cli.options import Output
from tubecert.cli.presenting import present
from tubecert.digits import near
from tubecert.errors import ExitCode, SpecError
from tubecert.expression import number_text
from tubecert.findings import Finding
from tubecert.library.numbers import Numbers
from tubecert.printable import printable_json, visible
from tubecert.records import Json
from tubecert.report import trade as told
from tubecert.spec.canonical import hardware_data
from tubecert.spec.hardware import LARGEST
from tubecert.spec.override import Setting

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.pipeline import Options
    from tubecert.pipeline.width import Measure
    from tubecert.progress import Progress
    from tubecert.spec import Spec

CORRIDOR: Final = "--corridor"
PARETO: Final = "--pareto"
QUANTITIES: Final[Mapping[str, HardwarePart]] = {
    "hardware.rate": "sample_time",
    "hardware.delay": "delay",
    "hardware.noise": "noise",
    "disturbance.bound": "wind",
}
TUBE: Final = "tube"
FILES: Final[Mapping[HardwarePart, str]] = {
    "sample_time": "rate",
    "delay": "delay",
    "noise": "noise",
    "wind": "wind",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A design, as far as these need it: `load` reads the specification with settings beside the command line's.

    `seal` makes the text of a certificate.
    """

    target: str
    load: Callable[[Sequence[Setting]], Spec]
    seal: Callable[[Result], str]
    options: Options
    measure: Measure
    progress: Progress | None


def corridor(words: str, asked: Asked, output: Output) -> ExitCode:
    """The cheapest machine for a tube, part by part."""
    from tubecert.pipeline.trade import cheapest

    tube = corridor_settings(words, asked)
    spec = asked.load(tube)
    parts = parts_of(spec)
    found = cheapest(
        lambda part: asked.load([*tube, largest(spec, part)]), parts, asked.options, asked.progress
    )
    files = {}
    for each in found:
        if each.value is not None:
            files[each.part] = _named(asked.target, FILES[each.part])
            certificate.write_text(files[each.part], asked.seal(each.result))
    data = printable_json(json.dumps(told.offers_data(found, files), indent=1, ensure_ascii=False)) + "\n"
    present(
        output,
        told.offers_summary(spec, found),
        lambda: told.offers(spec, found, files),
        data if output.json else None,
    )
    failed = next((each for each in found if each.value is None), None)
    return (
        ExitCode.CERTIFIED if len(files) == len(found) or failed is None else failed.result.verdict.exit_code
    )


def pareto(words: str, asked: Asked, output: Output, scaled: Callable[[Fraction], list[Setting]]) -> ExitCode:
    """The size of the tube against a number of the machine."""
    from tubecert.pipeline.trade import front

    key, part = quantities(words)
    spec = asked.load([])
    if part not in parts_of(spec):
        raise refused(PARETO, f"{key} is no single number of this machine", "see docs/design.md")
    found = front(
        lambda scale: asked.load([*scaled(scale), largest(spec, part)]),
        part,
        asked.measure,
        asked.options,
        asked.progress,
    )
    files = {}
    for number, point in enumerate(found.best, start=1):
        files[point.scale] = _named(asked.target, f"{number:02d}")
        certificate.write_text(files[point.scale], asked.seal(point.offer.result))
    stem = asked.target.removesuffix(".json")
    if files:
        certificate.write_text(f"{stem}.csv", told.table(found, files))
        certificate.write_text(f"{stem}.svg", told.drawn(found, part, spec.name))
    data = printable_json(json.dumps(told.front_data(found, files), indent=1, ensure_ascii=False)) + "\n"
    present(
        output,
        told.front_summary(spec, found, part),
        lambda: told.front(spec, found, part, files, stem),
        data if output.json else None,
    )
    return ExitCode.CERTIFIED if files else found.points[0].offer.result.verdict.exit_code


def refused(option: str, message: str, help: str) -> SpecError:
    """What is wrong with an option."""
    return SpecError([Finding(code="TC122", message=f"{option}: {message}", help=help)])


def quantities(words: str) -> tuple[str, HardwarePart]:
    """The number of the machine that is traded for the tube; raises `SpecError`."""
    names = [word.strip() for word in words.split(",")]
    others = [name for name in names if name != TUBE]
    if len(names) != 2 or len(others) != 1 or others[0] not in QUANTITIES:
        known = ", ".join(QUANTITIES)
        raise refused(PARETO, f"{visible(words)} is no pair of quantities", f"write tube and one of {known}")
    return others[0], QUANTITIES[others[0]]


def parts_of(spec: Spec) -> list[HardwarePart]:
    """The parts of a machine that can be the largest, each alone; raises `SpecError` without a machine."""
    own, wind = spec.hardware, spec.disturbance
    if own is None:
        raise refused(CORRIDOR, "the specification has no hardware", "write hardware: {rate: 500}")
    if own.largest is not None:
        help = "give every number of the machine"
        raise refused(CORRIDOR, f"the {own.largest} is already to be the largest", help)
    parts: list[HardwarePart] = ["sample_time", "delay"]
    if not isinstance(own.noise, tuple):
        parts.append("noise")
    if wind is not None and wind.rate is None:
        parts.append("wind")
    return parts


def largest(spec: Spec, part: HardwarePart) -> Setting:
    """The setting that asks for the largest value of a part, the rest of the machine being as it is."""
    if part == "wind":
        return Setting(path="disturbance.bound", text=LARGEST)
    machine = {} if spec.hardware is None else hardware_data(spec, spec.hardware)
    return Setting(path="hardware", text=_flow({**machine, part: LARGEST}))


def corridor_settings(words: str, asked: Asked) -> list[Setting]:
    """The tube that is asked for: half-widths by state, or the radius; raises `SpecError`."""
    if "=" in words:
        pairs = [each.partition("=")[::2] for each in words.split(",")]
        if not all(name.strip() and value.strip() for name, value in pairs):
            raise refused(CORRIDOR, f"{visible(words)} is no list STATE=WIDTH", "write px=0.2,pz=0.2")
        widths = {name.strip(): value.strip() for name, value in pairs}
        return [Setting(path=TUBE, text=_flow({"half_widths": widths}), option=CORRIDOR)]
    numbers = Numbers()
    radius = numbers.positive(CORRIDOR, words)
    if radius is None:
        raise SpecError(numbers.findings)
    return _radius_settings(radius, asked)


def _radius_settings(radius: Fraction, asked: Asked) -> list[Setting]:
    """`epsilon` and `rho_a` in proportion, so that the tube has a radius."""
    from tubecert.conditions.decimals import round_down
    from tubecert.pipeline import certify

    spec = asked.load([])
    if spec.tube.auto or spec.tube.epsilon is None or spec.tube.rho_a is None:
        help = f"name half-widths: {CORRIDOR} {spec.states[0]}=0.2"
        raise refused(CORRIDOR, "a radius belongs to a tube with epsilon and rho_a, a ball", help)
    tube = certify(spec, asked.options, asked.progress).tube
    own = spec.tube.epsilon + spec.tube.rho_a
    start = Fraction(0) if tube is None else tube.rho - own
    if start >= radius:
        help = f"the start alone takes {near(start, 4)}: ask for more"
        raise refused(CORRIDOR, f"no tube has the radius {number_text(radius)}", help)
    share = (radius - start) / own
    keys = {"epsilon": spec.tube.epsilon, "rho_a": spec.tube.rho_a}
    return [
        Setting(path=f"tube.{key}", text=number_text(round_down(float(value * share), 8)), option=CORRIDOR)
        for key, value in keys.items()
    ]


def _flow(value: Json) -> str:
    """Data as it stands in a line of YAML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(each)}" for key, each in value.items()) + "}"
    return str(value)


def _named(target: str, word: str) -> str:
    """A file beside the target."""
    path = Path(target)
    return str(path.with_name(f"{path.name.removesuffix('.json')}.{word}.json"))
