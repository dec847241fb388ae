"""Sections of a specification that no claim rests on: other commands read them."""

from __future__ import annotations

from tubecert.recheck.document import Members, Node
from tubecert.recheck.reading import TIME, Reader
from tubecert.recheck.specified.numbers import several
from tubecert.recheck.specified.plant import Plant

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
