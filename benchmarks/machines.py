"""Random machines against what is proven of them: the worst signals of a linear program, played on the machine itself.

    python benchmarks/machines.py                        1 000 machines, seeds 0 to 999: about an hour
    python benchmarks/machines.py --first 500 --count 20

A machine is that of its seed (tests/machines/machines.py): 1-3 states, 1-2 inputs, 0 to 2.5 samples of delay, stable or
not, at rest, moving or a family of plans, with parameters, winds and cubic terms. Printed is the largest share of a
half-width or of an input's deviation that was attained, and that the program says can be; above 1 something is wrong.
"""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "machines"))

from machines import Tables, drawn, met

from tubecert.errors import SpecError
from tubecert.loop_design.certification import certify
from tubecert.sampled_loop.record import Result, Stage
from tubecert.spec import load_text
from tubecert.verdict import Verdict

SAMPLES = (0, 1, 4, 60)
PATIENCE = 120  # s for one machine


class SlowError(Exception):
    """A machine took too long."""


def _give_up(*_: object) -> None:
    raise SlowError


def main() -> None:
    """One line for a machine, and what all of them say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000)
    asked = parser.parse_args()
    signal.signal(signal.SIGALRM, _give_up)
    met_by: Counter[str] = Counter()
    largest = 0.0
    for seed in range(asked.first, asked.first + asked.count):
        started = time.process_time()
        machine = drawn(seed)
        signal.alarm(PATIENCE)
        try:
            result = certify(load_text(machine.text(), f"machine_{seed}.yaml")).result
            shares = _shares(seed, result) if result.verdict is Verdict.CERTIFIED else ()
        except SlowError:
            word, told = "slow", f"more than {PATIENCE} s"
        except SpecError as error:  # B was drawn as 0
            word, told = "no question", error.findings[0].message
        else:
            word, told = result.verdict.value, " ".join(f"{lack.kind} {lack.where}" for lack in result.lacks)
            if shares:
                largest = max(largest, *shares)
                word += " LEFT" if max(shares) > 1 + 1e-9 else ""
                told = f"limit {shares[0]:.4f} attained {shares[1]:.4f} stages {len(result.tube)}"
        finally:
            signal.alarm(0)
        met_by[word] += 1
        print(f"{seed:5} {machine.sizes} {word:12} {told}  {time.process_time() - started:.1f} s", flush=True)
    print(f"{dict(met_by)}; the largest share {largest:.6f}")


def _shares(seed: int, result: Result) -> tuple[float, float]:
    """The largest limit, and the largest value that was attained, over what is proven."""
    machine, own = drawn(seed), result.controller
    assert own is not None
    end = result.claim.horizon
    last = max(SAMPLES) if end is None else int(end / machine.sample_time) - 1

    def proven(k: int, name: str) -> float:
        stage: Stage = max((each for each in result.tube if each.start <= k), key=lambda each: each.start)
        return float({**stage.half_widths, **stage.deviations}[name])

    tables = Tables(own.F, own.G, own.M, own.N)
    found = met(machine, tables, proven, tuple(sorted({min(k, last) for k in SAMPLES})))
    return max(one.limit / one.proven for one in found), max(one.attained / one.proven for one in found)


if __name__ == "__main__":
    main()
