"""The specification inside a certificate (`result.spec.effective`, canonical), read into closed types.

Its parts are read in `specified`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeVar

from tubecert.recheck.document import Members, Node, digest, wrong
from tubecert.recheck.obstacles import Obstacle, read_obstacle
from tubecert.recheck.specified.loop import (
    Disturbance,
    Hardware,
    Loop,
    read_disturbance,
    read_hardware,
    read_loop,
)
from tubecert.recheck.specified.numbers import TIME, Range, Reader, ends, positive, several
from tubecert.recheck.specified.plant import (
    Metric,
    Plant,
    Uncertainty,
    Wanted,
    read_metric,
    read_plant,
    read_uncertainty,
)
from tubecert.recheck.specified.trajectory import (
    AnyPlan,
    Start,
    Trajectory,
    read_lasting,
    read_start,
    read_trajectory,
)
from tubecert.recheck.times import period_of

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What every specification says; `hash` is of the canonical bytes."""

    plant: Plant
    uncertainty: Uncertainty
    trajectory: Trajectory
    start: Start
    half_widths: dict[str, Fraction]  # at most; empty if none are asked for
    obstacles: tuple[Obstacle, ...]
    limits: dict[str, Range]  # by input, of some of them
    disturbance: Disturbance | None
    hash: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification(Asked):
    """A loop in continuous time; `content` is a hash of what a claim may rest on."""

    metric: Metric | Wanted
    epsilon: Fraction | None  # None: with half-widths they follow from these
    rho_a: Fraction | None
    coordinates: bool  # whether the tube has coordinates of its own
    loop: Loop
    content: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSpecification(Asked):
    """A loop that a computer closes, without a metric.

    `afterwards`: nothing (also where there is no horizon), rest or repeat. `controller`: auto or none.
    """

    afterwards: str
    hardware: Hardware
    controller: str


_ALWAYS = ("tubecert", "name", "system", "safe_set", "uncertainty", "trajectory", "initial_state", "tube")
_OPTIONAL = ("expect", "simulation", "obstacles", "limits", "disturbance")


def read_specification(node: Node) -> Specification:
    """That of a loop in continuous time; raises `CertificateError` for whatever is not of the canonical form."""
    own = node.closed(*_ALWAYS, "adaptation", "conditions", "metric", optional=_OPTIONAL)
    plant = read_plant(own["system"], own["safe_set"])
    tube = _tube(own["tube"], plant)
    found = Specification(
        **_asked(node, own, plant, read_trajectory(own["trajectory"], plant), sampled=False),
        metric=read_metric(own["metric"], plant),
        epsilon=tube.get("epsilon", positive),
        rho_a=tube.get("rho_a", positive),
        coordinates="coordinates" in tube,
        half_widths=tube.get("half_widths", _widths) or {},
        loop=read_loop(own["adaptation"], own["conditions"]),
        content=digest({key: value for key, value in node.mapping().items() if key not in IDLE}),
    )
    if plant.varies:
        _moving(own, found)
    if plant.gained is not None:
        raise own["system"].refused("has a B that is not known, which no theorem covers")
    return found


def read_sampled_specification(node: Node) -> SampledSpecification:
    """That of a loop that a computer closes; raises `CertificateError` for whatever is not of the canonical form.

    B may depend on parameters known by ranges; f is free of t. Half-widths are at most those asked for.
    """
    own = node.closed(*_ALWAYS, "hardware", "controller", optional=_OPTIONAL)
    plant = read_plant(own["system"], own["safe_set"])
    if plant.varies:
        raise own["system"].refused("has an f that depends on t, which a sampled loop may not have")
    wishes = own["tube"].closed(optional=("half_widths",))
    trajectory, afterwards = read_lasting(own["trajectory"], plant)
    return SampledSpecification(
        **_asked(node, own, plant, trajectory, sampled=True),
        afterwards=afterwards,
        half_widths=wishes.get("half_widths", lambda item: _some(item, tuple(plant.lengths), positive)) or {},
        hardware=read_hardware(own["hardware"], plant.states),
        controller=own["controller"].word("auto", "none"),
    )


def _asked(
    node: Node, own: Members, plant: Plant, trajectory: Trajectory, *, sampled: bool
) -> dict[str, Any]:
    """What is read alike of both; raises for a family of plans that does not start within a radius."""
    if own["tubecert"].count() != 1:
        said = own["tubecert"]
        raise wrong("TC602", f"{said.path} is {said.value!r}; this version reads 1", "use a newer tubecert")
    own["name"].text()
    read_idle(own, plant)
    start = read_start(own["initial_state"], plant.states)
    if isinstance(trajectory, AnyPlan) and start.within is None:
        raise own["initial_state"].refused("must be `within`: a family of plans has no start of its own")
    obstacles = own.get("obstacles", lambda item: [read_obstacle(it, plant.states) for it in item.entries()])
    return {
        "plant": plant,
        "uncertainty": read_uncertainty(own["uncertainty"], plant, sudden=sampled),
        "trajectory": trajectory,
        "start": start,
        "obstacles": tuple(obstacles or ()),
        "limits": own.get("limits", lambda item: _some(item, plant.inputs, ends)) or {},
        "disturbance": own.get(
            "disturbance", lambda item: read_disturbance(item, plant.states, sampled=sampled)
        ),
        "hash": digest(node.value),
    }


def _moving(own: Members, found: Specification) -> None:
    """What an f that depends on t goes with: a metric that is written down, and a period if there is no horizon."""
    if found.trajectory.horizon is None:
        try:
            period_of(found.uncertainty, found.plant.moving)
        except ValueError as error:
            raise own["system"].refused(f"cannot be examined: {error}") from None
    if not isinstance(found.metric, Metric):
        raise own["system"].refused("has an f that depends on t, beside what no theorem covers with it")


def _tube(node: Node, plant: Plant) -> Members:
    """Radii in x, radii in coordinates that the certificate states, or half-widths, which have such coordinates."""
    own = node.closed(optional=("epsilon", "rho_a", "coordinates", "half_widths", "gap"))
    own.get("gap", lambda item: item.word("auto"))
    own.get("coordinates", lambda item: item.word("auto"))
    if "half_widths" not in own:
        own.require("epsilon", "rho_a")
        return own
    own.require("coordinates")
    widths = own["half_widths"]
    widths.closed(optional=tuple(plant.lengths))
    if "epsilon" in own or not widths.mapping():
        raise node.refused("must have epsilon, or half-widths of some states or outputs")
    return own


def _some(node: Node, names: Sequence[str], reads: Callable[[Node], T]) -> dict[str, T]:
    """What is said of some of these, and of one at least, in their order."""
    own = node.closed(optional=names)
    if not node.mapping():
        raise node.refused(f"must name one of {', '.join(names)}")
    return {name: reads(own[name]) for name in names if name in own}


def _widths(node: Node) -> dict[str, Fraction]:
    return {name: positive(value) for name, value in node.items()}


IDLE = ("name", "expect", "simulation", "obstacles", "limits")
_LOCKED = ("rho", "clearance", "inputs", "bandwidth", "adaptation_rate", "largest_rate")


def read_idle(own: Members, plant: Plant) -> None:
    """Known keys all the same."""
    if "expect" in own:
        locked = own["expect"].closed(optional=("verdict", "metric", "half_widths", *_LOCKED))
        for key in ("verdict", "metric"):
            locked.get(key, Node.text)
        for key in _LOCKED:
            locked.get(key, lambda item: several(item, 2))
        if "half_widths" in locked:
            widths = locked["half_widths"].closed(optional=plant.lengths)
            for key in plant.lengths:
                widths.get(key, lambda item: several(item, 2))
    if "simulation" in own:
        numbers, texts = ("runs", "seed", "duration"), ("controllers", "plane", "h")
        simulation = own["simulation"].closed(optional=("gains", *numbers, *texts))
        simulation.get("gains", Node.text)
        simulation.get(
            "h",
            lambda item: Reader.of((*plant.states, TIME), plant.tables, kinks=True).column(
                item, len(plant.inputs)
            ),
        )
        for key in numbers:
            simulation.get(key, Node.exact)
        for key in texts:
            simulation.get(key, Node.texts)
