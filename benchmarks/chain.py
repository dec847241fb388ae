"""Chains of pendula: the time of a certification against the number of states, with one gap for all and with `auto`.

Each pendulum is driven, hangs by its neighbours and turns an uncertain spring: q' = w, w' = -sin q - w/5 + (neighbours)
+ u + h. The metric is constant, in closed form: where W = diag(W1), W1 = [[1, -3/2], [-3/2, 3]], C1 asks for
-3/2 + rate < 0 alone.
"""

from __future__ import annotations

import argparse
import time

from tubecert.pipeline import Options, certify
from tubecert.spec import load_text


def chain(count: int) -> str:
    """The specification of `count` pendula."""
    q, w, u = ([f"{letter}{i}" for i in range(1, count + 1)] for letter in "qwu")
    states = [name for pair in zip(q, w, strict=True) for name in pair]
    f, B = [], []
    for i in range(count):
        beside = [q[j] for j in (i - 1, i + 1) if 0 <= j < count]
        pull = "".join(f" + sin({other} - {q[i]})/2" for other in beside)
        f += [w[i], f"-sin({q[i]}) - {w[i]}/5{pull}"]
        B += [[0] * count, [int(j == i) for j in range(count)]]
    W = [["0"] * 2 * count for _ in range(2 * count)]
    for i in range(0, 2 * count, 2):
        W[i][i : i + 2], W[i + 1][i : i + 2] = ["1", "-3/2"], ["-3/2", "3"]
    lines = [
        "tubecert: 1",
        f"name: chain{count}",
        "system:",
        f"  states: [{', '.join(states)}]",
        f"  inputs: [{', '.join(u)}]",
        "  f:",
        *(f"    - {entry}" for entry in f),
        f"  B: {B}",
        "safe_set:",
        *(f"  {name}: [-2, 2]" for name in states),
        "uncertainty:",
        f"  h: [{', '.join(f'sin(2*{name})/10' for name in q)}]",
        f"trajectory: {{kind: equilibrium, at: {[0] * 2 * count}, input: {[0] * count}}}",
        f"initial_state: {{at: {[0] * 2 * count}}}",
        "metric:",
        "  rate: 1",
        "  dual_metric:",
        *(f"    - [{', '.join(row)}]" for row in W),
        f"tube: {{half_widths: {{{', '.join(f'{name}: 0.3' for name in q)}}}, coordinates: auto}}",
        "conditions: {decides: B}",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Certifications of chains, in turns; `auto` over 1/100 in time and in Gamma, each once: minutes."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("counts", nargs="*", type=int, default=[1, 2, 3], help="of pendula  [1 2 3]")
    asked.add_argument("--auto", type=int, nargs="*", default=[], help="more of them, with auto alone")
    given = asked.parse_args()
    for count in [*given.counts, *given.auto]:
        auto, gain = timed(count, Options(by_effect=True))
        line = f"{2 * count} states: auto {auto:.1f} s, Gamma {gain:.4g}"
        if count in given.counts:
            before, reference = timed(count, Options())
            line += f"; 1/100 {before:.1f} s, Gamma {reference:.4g}; ratios {auto / before:.2f}, {gain / reference:.3f}"
        print(line, flush=True)


def timed(count: int, options: Options) -> tuple[float, float]:
    """Processor time in s of a certification, and Gamma."""
    started = time.process_time()
    found = certify(load_text(chain(count), "chain.yaml"), options)
    pair = found.sections["distance"].pairs(asked=False)[0]
    return time.process_time() - started, float(pair.adaptation_rate or 0)


if __name__ == "__main__":
    main()
