"""Tries to break certificates, and shows that it can: random runs and adversaries, with the gains and far below them.

    python benchmarks/falsify.py              everything: 10 000 and 1 000 random runs, about 10 minutes on 2 cores
    python benchmarks/falsify.py --runs 200   at most 200 runs each

What is printed is the largest d/dbar that was met; above 1 the tube was left.
"""

from __future__ import annotations

import argparse
import time
from fractions import Fraction
from pathlib import Path

from tubecert import pipeline
from tubecert.letters import DISTANCE
from tubecert.simulation.adaptive.campaign import Attack, simulate
from tubecert.simulation.adaptive.loops import Loop
from tubecert.simulation.adaptive.setting import Choice, Setting, loop_of, setting_of
from tubecert.spec import load

CONFIGS = Path(__file__).parent.parent / "configs"
SYSTEMS = {"two_state": 10_000, "three_state": 1_000}
FEW = 100  # random runs of the comparisons
FAR_BELOW = (Fraction(1, 10), Fraction(1, 1000))  # of omega, of Gamma


def main() -> None:
    """Prints one row for each loop that is attacked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=max(SYSTEMS.values()))
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    print(f"{'system':12} {'loop':44} {'runs':>6} {'left':>6} {'random':>8} {'adversary':>9} {'runs/s':>7}")
    for name, count in SYSTEMS.items():
        setting = _setting(name)
        few = min(FEW, asked.runs)
        _row(setting, loop_of(setting, "l1", Choice()), min(count, asked.runs), asked.seed)
        _row(setting, _far_below(setting), few, asked.seed)


def _setting(name: str) -> Setting:
    spec = load(str(CONFIGS / f"{name}.yaml"))
    return setting_of(spec, pipeline.certify(spec, pipeline.Options()))


def _far_below(setting: Setting) -> Loop:
    proven = setting.proven(DISTANCE)
    assert proven is not None
    omega, Gamma = FAR_BELOW
    choice = Choice(bandwidth=proven.bandwidth * omega, adaptation_rate=proven.adaptation_rate * Gamma)
    return loop_of(setting, "l1", choice)


def _row(setting: Setting, loop: Loop, count: int, seed: int) -> None:
    started = time.perf_counter()
    campaign = simulate(setting, [loop], count=count, seed=seed)
    (attack,) = campaign.attacks
    rate = count / (time.perf_counter() - started)
    assert attack.adversary is not None
    shares = [_share(attack.random.comparison), _share(attack.adversary.comparison)]
    left = attack.random.comparison.left_the_tube
    row = f"{setting.spec.name:12} {_words(loop):44} {count:6} {left:6} {shares[0]:>8} {shares[1]:>9} {rate:7.0f}"
    print(row + _notes(attack), flush=True)


def _share(found: object) -> str:
    use = getattr(found, "worst", {}).get("distance")
    return "-" if use is None or use.share is None else f"{use.share:.3f}"


def _notes(attack: Attack) -> str:
    """Broken promises and runs without a result, if there are any."""
    broken = [item.of for item in attack.random.comparison.violations]
    lost = attack.random.comparison.no_result
    return (f"  BROKEN: {', '.join(broken)}" if broken else "") + (f"  no result: {lost}" if lost else "")


def _words(loop: Loop) -> str:
    gains = loop.gains
    assert gains is not None
    chosen = "B" if loop.promise else "chosen"
    return f"{loop.controller}, omega {gains.bandwidth:.4g}, Gamma {gains.adaptation_rate:.4g}, {chosen}"


if __name__ == "__main__":
    main()
