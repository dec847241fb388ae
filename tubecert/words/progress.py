"""How far a command is, as a sentence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from tubecert.letters import NAMES
from tubecert.progress import Phase, Step, Unit

if TYPE_CHECKING:
    from tubecert.synthesis.problem import Size

# of a phase: what it is called, what stands behind its numbers, and what to do where a command was ended in it
_SAID: Final = {
    Phase.CERTIFICATION: (
        "proving",
        "claims",
        "a wider --gap, a smaller safe set or tube, --jobs, or more time",
    ),
    Phase.PLAN: ("planning", "claims", "a plan of your own, fewer knots, or more time"),
    Phase.GAINS: ("gains of certificate", "claims", "--conditions for one certificate only, or more time"),
    Phase.LOOP: ("sampled loop", "", "a nearer start, a plan or parameters in narrower ranges, or more time"),
    Phase.SYNTHESIS: (
        "looking for a metric",
        "",
        "a lower --rate, --degree 0, fewer --variables, a smaller safe set, or more time",
    ),
    Phase.VERIFICATION: ("verifying", "metrics", "a smaller safe set, a wider --gap, or more time"),
    Phase.CHECK: ("checking", "files", "fewer files, or --jobs"),
    Phase.SWEEP: ("certifying points", "points", "the same command goes on where it ended"),
    Phase.SIMULATION: ("simulating", "runs", "fewer --runs, or a shorter --duration"),
    Phase.FIGURES: ("figures and data", "", "the same command once more"),
    Phase.RECHECK: ("examining", "claims", "a smaller --budget tells earlier which claims are hard"),
}
_OF_CONSTANTS: Final = (Phase.CERTIFICATION, Phase.CHECK)
_JOINED: Final = (Phase.CERTIFICATION, Phase.GAINS)  # where the name continues the sentence
_ONE: Final = {Unit.BOXES: "box", Unit.KNOTS: "knot", Unit.PIECES: "piece", Unit.STEPS: "step"}
_LETTERS: Final = {name.key: name.letter for name in NAMES}


def described(step: Step) -> str:
    """The whole first, which matters most where a line is cut: how much is done, the time, what is worked on."""
    return "; ".join(filter(None, (_done(step), _time(step), _now(step))))


def out_of_reach(size: Size) -> str:
    """That a search is not likely to end, and how large it is."""
    return (
        f"{size.states} states, and slopes that depend on {size.moving} of them: the largest search for a metric that "
        f"was seen to end has 9, and 3. A constant W has {size.entries} unknown entries, and is proven on boxes with "
        f"{size.vertices:,} vertices. Better: fewer states, a metric of your own, or --deadline"
    )


def next_step(phase: Phase) -> str:
    """What to do where a command was ended in a phase."""
    return _SAID[phase][-1]


def duration(seconds: float) -> str:
    """A time as one reads it."""
    if seconds < 100:
        return f"{math.ceil(seconds)} s"
    minutes = seconds / 60
    return f"{round(minutes)} min" if minutes < 100 else f"{minutes / 60:.1f} h"


def came_to(step: Step) -> str:
    """A search that was done: for a constant, whose value only the certificate tells, or for gains."""
    words = f"certificate {_name(step)}" if step.phase is Phase.GAINS else _name(step)
    return f"{words}, {_counted(step)}" if step.count else words


def _done(step: Step) -> str:
    _, counted, _ = _SAID[step.phase]
    if not counted or (step.of is None and not step.done):
        return ""
    return f"{step.done} {counted} done" if step.of is None else f"{step.done} of {step.of} {counted} done"


def _time(step: Step) -> str:
    gone = f"{duration(step.seconds)} so far" if step.seconds else ""
    left = "" if step.left is None else f"{'at least' if step.least else 'about'} {duration(step.left)} left"
    return ", ".join(part for part in (gone, left) if part)


def _now(step: Step) -> str:
    """What is worked on, and what its search says."""
    name = _name(step)
    joined = " " if step.phase in _JOINED else ": "
    at, *_ = _SAID[step.phase]
    words = f"{at}{joined}{name}" if name else at
    if step.count:
        words += f", {_counted(step)}"
    if step.share > 0:
        words += f", {100 * step.share:.0f} % of this part proven"
    return words


def _counted(step: Step) -> str:
    return f"{step.count:,} {step.unit if step.count != 1 else _ONE[step.unit]}"


def _name(step: Step) -> str:
    """What is worked on as reports call it: a constant by its words."""
    if step.phase is Phase.GAINS:
        return _LETTERS.get(step.name, step.name)
    if step.phase not in _OF_CONSTANTS or step.unit is not Unit.BOXES:
        return step.name
    from tubecert.bounds.constants import EVERY  # with numerics, which are there where constants are bounded

    return EVERY[step.name].words if step.name in EVERY else step.name.replace("_", " ")
