"""How far a command is, as a sentence."""

from __future__ import annotations

import math
from typing import Final

from tubecert.digits import near
from tubecert.letters import NAMES
from tubecert.progress import Phase, Step, Unit

COUNTED: Final = {
    Phase.CERTIFICATION: "claims",
    Phase.PLAN: "claims",
    Phase.GAINS: "claims",
    Phase.RECHECK: "claims",
    Phase.DESIGN: "tubes",
    Phase.VERIFICATION: "metrics",
    Phase.CHECK: "files",
    Phase.SWEEP: "points",
    Phase.COMPILATION: "functions",
    Phase.SIMULATION: "runs",
}
_AT: Final = {
    Phase.CERTIFICATION: "proving",
    Phase.PLAN: "planning",
    Phase.GAINS: "gains of certificate",
    Phase.ADVICE: "looking for what would certify",
    Phase.SYNTHESIS: "looking for a metric",
    Phase.DESIGN: "trying tubes",
    Phase.VERIFICATION: "verifying",
    Phase.CHECK: "checking",
    Phase.SWEEP: "certifying points",
    Phase.COMPILATION: "compiling the loops, once per installation",
    Phase.SIMULATION: "simulating",
    Phase.FIGURES: "figures and data",
    Phase.RECHECK: "examining",
}
_JOINED: Final = (Phase.CERTIFICATION, Phase.GAINS)  # where the name continues the sentence
_OF_CONSTANTS: Final = (Phase.CERTIFICATION, Phase.ADVICE, Phase.DESIGN, Phase.CHECK)
_ONE: Final = {Unit.BOXES: "box", Unit.KNOTS: "knot", Unit.PIECES: "piece", Unit.STEPS: "step"}
_LETTERS: Final = {name.key: name.letter for name in NAMES}


def described(step: Step) -> str:
    """The whole first, which matters most where a line is cut: how much is done, the time, what is worked on."""
    whole = [_done(step), _time(step)]
    return "; ".join(part for part in (*whole, _now(step)) if part)


def duration(seconds: float) -> str:
    """A time as one reads it."""
    if seconds < 100:
        return f"{math.ceil(seconds)} s"
    minutes = seconds / 60
    return f"{round(minutes)} min" if minutes < 100 else f"{minutes / 60:.1f} h"


def _done(step: Step) -> str:
    counted = COUNTED.get(step.phase)
    if counted is None or (step.of is None and not step.done):
        return ""
    if step.of is None:
        return f"{step.done} {counted} done"
    return f"{step.done} of {step.of} {counted} done"


def _time(step: Step) -> str:
    gone = f"{duration(step.seconds)} so far" if step.seconds else ""
    left = "" if step.left is None else f"{'at least' if step.least else 'about'} {duration(step.left)} left"
    return ", ".join(part for part in (gone, left) if part)


def _now(step: Step) -> str:
    """What is worked on, and what its search says."""
    name = _name(step)
    joined = " " if step.phase in _JOINED else ": "
    words = f"{_AT[step.phase]}{joined}{name}" if name else _AT[step.phase]
    if step.count:
        unit = str(step.unit) if step.count != 1 else _ONE[step.unit]
        words += f", {step.count:,} {unit}"
    if step.share > 0:
        words += f", {100 * step.share:.0f} % of this part proven"
    if math.isfinite(step.below) and math.isfinite(step.above):
        words += f", between {near(step.below, 4)} and {near(step.above, 4)}"
    return words


def _name(step: Step) -> str:
    """What is worked on as reports call it: a constant by its words."""
    if step.phase is Phase.GAINS:
        return _LETTERS.get(step.name, step.name)
    if step.phase not in _OF_CONSTANTS:
        return step.name
    from tubecert.bounds.meanings import EVERY  # with numerics, which are there where constants are bounded

    return EVERY[step.name].words if step.name in EVERY else step.name.replace("_", " ")
