"""Members that the sections of several kinds have, read."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Members, Node
from tubecert.recheck.enclosures import enclosure
from tubecert.recheck.kinds.kind import Shortfall
from tubecert.recheck.predictor import Gains
from tubecert.recheck.specified.numbers import Numbers

GAINS = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")


@dataclass(frozen=True, slots=True)
class Point:
    """A point of a curve of gains."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction

    def at(self, R_H: Fraction) -> Gains:
        """Its gains, with the radius of the projection that the pair has."""
        return Gains(
            bandwidth=self.bandwidth,
            adaptation_rate=self.adaptation_rate,
            predictor_gain=self.predictor_gain,
            projection_radius=R_H,
        )


@dataclass(frozen=True, slots=True)
class Around:
    """Proven margins along the bandwidth, by claim; None where nothing is proven."""

    bandwidths: Numbers
    adaptation_rate: Fraction
    predictor_gain: Fraction
    margins: dict[str, tuple[Fraction | None, ...]]

    def at(self, k: int, R_H: Fraction) -> Gains:
        """The gains at one bandwidth."""
        return Point(self.bandwidths[k], self.adaptation_rate, self.predictor_gain).at(R_H)


def read_gains(own: Members) -> Gains:
    """The four gains of A and B."""
    return Gains(
        bandwidth=own["bandwidth"].decimal(),
        adaptation_rate=own["adaptation_rate"].decimal(),
        predictor_gain=own["predictor_gain"].decimal(),
        projection_radius=own["projection_radius"].decimal(),
    )


def read_curve(node: Node) -> tuple[Point, ...]:
    """Points of a curve."""
    return tuple(map(_point, node.entries()))


def _point(node: Node) -> Point:
    own = node.closed("bandwidth", "adaptation_rate", "predictor_gain")
    gains = own["bandwidth"].decimal(), own["adaptation_rate"].decimal()
    return Point(*gains, own["predictor_gain"].decimal())


def read_around(node: Node, claims: tuple[str, ...]) -> Around:
    """Margins along the bandwidth: bandwidths, the rate and the predictor of the pair, and each margin there."""
    own = node.closed("bandwidth", "adaptation_rate", "predictor_gain", *claims)
    bandwidths = own["bandwidth"].decimals()
    margins = {
        claim: tuple(
            None if item.value is None else item.number() for item in own[claim].sized(len(bandwidths))
        )
        for claim in claims
    }
    gain = own["predictor_gain"].decimal()
    return Around(bandwidths, own["adaptation_rate"].decimal(), gain, margins)


def read_shortfalls(node: Node) -> tuple[Shortfall, ...]:
    """What is missing."""
    found = []
    for item in node.entries():
        own = item.closed("condition", "margin", "allowed", "needed", "missing", optional=("constant",))
        own.get("constant", Node.text)
        for key in ("allowed", "needed", "missing"):
            own.known(key, Node.number)
        found.append(Shortfall(own["condition"].text(), enclosure(own["margin"])))
    return tuple(found)
