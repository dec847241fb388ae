"""The tube and what decides: the sections `tube`, `adaptation`, `conditions` and `expect`, and the name of the file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Final, Literal

from tubecert import letters
from tubecert.expression import number_text
from tubecert.spec import codes, keys
from tubecert.spec.keys import AUTO, CHOSEN, Kind, Section, entry, key, named, number, says, section, word
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.values import Ends
from tubecert.verdict import Verdict

VERDICTS: Final = ("certified", "refuted", "undecided")
METRICS: Final = {Verdict.CERTIFIED: "holds", Verdict.REFUTED: "refuted", Verdict.UNDECIDED: "undecided"}
WIDTHS: Final = "half_widths"  # ranges by state and output

SLUG: Final = "[A-Za-z0-9][A-Za-z0-9_-]{0,63}"
_RADIUS: Final = number(above=0, side="below")
_MANY: Final = 4  # states: a ball of so many is rarely what is meant, or what a metric can fill


def read_name(field: Field) -> str | None:
    """The specification's name, which becomes part of file names."""
    name = field.text("a name")
    if name is None or re.fullmatch(SLUG, name):
        return name
    slug = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:64]
    message = f"{name[:60]!r} cannot be a name"
    help = "use ASCII letters, digits, _ and -, at most 64" + (f": {slug}" if slug else "")
    return field.fail(codes.NAME, message, help)


def _gap(field: Field, _: Names) -> str | None:
    text = field.node.text
    if re.fullmatch(r"[0-9./eE%+-]+", text) is None:
        return field.word((AUTO,))
    help = f"write auto here; a number is an option: --gap {text[:20]}"
    return field.fail(codes.RANGE, f"{field.path} is {text[:20]}", help)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """How wide the tube is: half-widths of states, or two radii (also --epsilon and --rho-a). Beside hardware the
    narrowest that is found, unless half-widths are wished for.

    `half_widths` are pairs of the name of a state or an output and its half-width; `coordinates` None: not said.
    """

    epsilon: Fraction | None = key(_RADIUS, None, example=0.01)
    """Radius beyond the initial offset, for the filter's error; > 0."""
    rho_a: Fraction | None = key(_RADIUS, None, example=0.01)
    """Radius left to the adaptation; > 0. Beside half_widths it may be left out: half of what the start leaves."""
    coordinates: Literal["identity", "auto"] | None = key(word("identity", "auto"), None)
    """What the tube is measured in. identity: the tube is a Euclidean ball of states, and gains depend on their units.
    auto: it is an ellipsoid of the metric, cut to half-widths: no state is off by more than epsilon + rho_a and what
    the start takes, and one may be. By default auto beside half_widths, where units of states differ, and with four or
    more states; else identity."""
    half_widths: tuple[tuple[str, Fraction], ...] = key(
        named("lengths", _RADIUS, "0.1"), (), example={"q": 0.15}
    )
    """Bounds of |x_i - x_i*| for some or all states, and of |c'(x - x*)| for outputs (system.outputs), in their units,
    in place of epsilon: the widest tube within them is taken. Beside hardware they are wishes: the controller is
    designed for a tube within them."""
    gap: Literal["auto"] | None = key(Kind(_gap, {"enum": [AUTO]}), None)
    """How closely the constants over the tube are enclosed. auto: each by its effect, until closer ones would lower the
    gains that decide by less than 1 %; where some take long, this is much faster. By default so for half-widths of four
    or more states or along a plan that moves; else all of them to the gap of the command, 1 %."""

    @property
    def auto(self) -> bool:
        """Whether the tube has coordinates of its own, in which it is measured by the metric."""
        return self.coordinates == "auto" or (self.coordinates is None and bool(self.half_widths))


TUBE: Final = section(Tube, reserved=("weights",))


def read_tube(field: Field, names: Names) -> Tube | None:
    """The two radii or the half-widths, as far as they are given, and the coordinates they are measured in."""
    entries = TUBE.entries(field)
    values = TUBE.sound(entries, names)
    if entries is None or values is None:
        return None
    tube = Tube(**values)
    if tube.half_widths and (radius := entries.get("epsilon")):
        help = "they fix the whole tube: give one of the two"
        return radius.fail(codes.RANGE, f"{radius.path} beside half_widths", help)
    if tube.half_widths and tube.coordinates == "identity":
        message, help = "half_widths with coordinates: identity", "write coordinates: auto, or leave it out"
        return entries["coordinates"].fail(codes.RANGE, message, help)
    return tube


def measured(tube: Tube, states: Sequence[str], units: Mapping[str, str]) -> Tube:
    """The tube with its coordinates said: a ball is what few states of one unit have by default."""
    if tube.coordinates is not None or tube.half_widths:
        return tube
    known = {units[name] for name in states if name in units}
    return replace(tube, coordinates=AUTO if len(known) > 1 or len(states) >= _MANY else "identity")


def tube_data(tube: Tube, spec: Any) -> dict[str, Any]:
    """The canonical form; the identity goes without saying, and any coordinates beside hardware."""
    data = TUBE.written(tube, spec)
    data.pop("coordinates", None)
    return data | ({"coordinates": AUTO} if tube.auto and spec.hardware is None else {})


def _predictor(field: Field, names: Names) -> Fraction | object | None:
    """The g of A_m = -g I."""
    if says(field, AUTO):
        return CHOSEN
    if field.node.kind != "scalar":
        message = f"{field.path} is a matrix; the predictor is a multiple of the identity"
        help = "write auto, or a negative number: -10 stands for -10 I; no matrix serves better than auto"
        return field.fail(codes.STABILITY, message, help)
    value = field.number(names.values)
    if value is not None and value >= 0:
        message = (
            f"{field.path} is {number_text(value)}, and a predictor that is stable needs a negative number"
        )
        return field.fail(codes.STABILITY, message, "write auto, or -10, which stands for -10 I")
    return None if value is None else -value


_SMOOTH: Final = Section(
    words="Smooth projection.",
    keys={
        "smooth": entry(
            number(above=0, most=1), words="Layer, relative; 0 < smooth <= 1.", needed=True, example=0.1
        )
    },
)


def _projection(field: Field, names: Names) -> Fraction | object | None:
    if field.node.kind == "scalar":
        return CHOSEN if field.word(("hard",)) else None
    return (_SMOOTH.sound(_SMOOTH.entries(field), names) or {}).get("smooth")


_NEGATIVE: Final = {"anyOf": [{"const": AUTO}, keys.NUMBER], "examples": [-1, AUTO]}
_HARD: Final = {"anyOf": [{"const": "hard"}, {"section": _SMOOTH}]}


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """Predictor and projection of the adaptive law.

    The g of A_m = -g I, None: chosen with the gains; the smooth projection's layer, None if hard.
    """

    predictor_gain: Fraction | None = key(
        Kind(_predictor, _NEGATIVE, lambda g, _: AUTO if g is None else number_text(-g)),
        None,
        name="A_m",
        said=AUTO,
        always=True,
    )
    """The predictor -g I as a negative number -g, or auto (each certificate takes the one that suits it best). A matrix
    would serve no better."""
    smooth: Fraction | None = key(
        Kind(_projection, _HARD, lambda layer, _: {"smooth": number_text(layer)} if layer else "hard"),
        None,
        name="projection",
        said="hard",
        always=True,
    )
    """The projection of the estimate: hard, or smooth with a layer."""


ADAPTATION: Final = section(Adaptation)

_LETTERS: Final = {each: letters.name_of(each).letter for each in letters.words_of()} | {
    letters.ALL: letters.ALL
}
CONDITIONS: Final = Section(
    words="Which certificate decides.",
    keys={
        "decides": entry(
            word(*_LETTERS, also=(26, 0), means=_LETTERS),
            words="The certificate that decides the verdict: 0 (none: without adaptation), A (the paper's), "
            "B (distance), or all of A and B; A if it is not said. The option --conditions overrides it.",
        )
    },
)


def decides_data(letter: str | None, _spec: Any) -> dict[str, str]:
    """The canonical form."""
    return {} if letter is None else {"decides": letter}


_RANGE: Final = keys.ends(
    sides=("nearest", "nearest"), order="the range is empty", help="write [least, most]", equal=True
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """A locked result: `check --certify` fails if the certificate, or the verification of a metric alone, says anything
    else. Beside hardware: verdict, half_widths and inputs.
    """

    verdict: str | None = key(word(*VERDICTS), None)
    """The verdict; not of a metric alone."""
    metric: str | None = key(word(*METRICS.values()), None)
    """Whether C1-C3 hold on the safe set at the metric's rate."""
    half_widths: tuple[tuple[str, Ends], ...] = key(
        named("lengths", _RANGE), (), example={"q": ["0.05", "0.2"]}
    )
    """By state, [least, most] of the half-width of the tube, whatever the time."""
    rho: Ends | None = key(_RANGE, None)
    """[least, most] of the tube's radius."""
    clearance: Ends | None = key(_RANGE, None)
    """[least, most] of the least clearance of the tube from an obstacle."""
    inputs: Ends | None = key(_RANGE, None)
    """[least, most] of the largest share of its limits that an input uses: 0 in the middle of them, 1 at one of
    them."""
    bandwidth: Ends | None = key(_RANGE, None)
    """[least, most] of the bandwidth omega, in rad/s."""
    adaptation_rate: Ends | None = key(_RANGE, None)
    """[least, most] of the adaptation rate Gamma."""
    largest_rate: Ends | None = key(_RANGE, None)
    """The largest rate that the metric is proven to support, in 1/s."""

    @property
    def ranges(self) -> list[tuple[str, Ends]]:
        """What ranges are expected of, those of half-widths after a dot."""
        alone = ((name, getattr(self, name)) for name in EXPECT.keys if name not in _NO_RANGES)
        widths = ((f"{WIDTHS}.{name}", ends) for name, ends in self.half_widths)
        return [(name, ends) for name, ends in (*alone, *widths) if ends is not None]


EXPECT: Final = section(Expectation)


_ALONE: Final = ("metric", "largest_rate")
_NO_RANGES: Final = ("verdict", "metric", WIDTHS)


def read_expectation(field: Field | None, names: Names, *, alone: bool) -> Expectation | None:
    """Locked results: verdicts, and [least, most] of numbers of the certificate; `alone`: of a metric alone."""
    others = [field.get(name) for name in EXPECT.keys if name not in _ALONE] if alone and field else []
    for own in filter(None, others):
        message = f"{own.path} in a question about a metric alone"
        help = f"write metric: {', '.join(METRICS.values())}; the number that can be expected is largest_rate"
        own.fail(codes.RANGE, message, help)
    found: Expectation | None = EXPECT.read(field, names)
    return found
