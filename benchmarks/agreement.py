"""Both sides of every constant in both arithmetics: `above` is confirmed, a little below `below` never is.

    python benchmarks/agreement.py plant.certificate.json ... [--boxes 2000]

"contradicted" is a proof that the bound of the certificate is attained within the gap; "undecided" is none, and no
disagreement. Exit code 1 if a bound is confirmed that lies below what the certificate says is attained.
"""

import argparse
import sys
import time
from fractions import Fraction
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from flint import ctx

from tubecert.recheck.certificate import opened, read_result
from tubecert.recheck.claims import Case
from tubecert.recheck.constants import OVER_TUBE, bounded
from tubecert.recheck.document import read

_LARGEST = Fraction(10)  # of mu in the search for du: more than smax(Theta B) of the shipped systems


def main() -> int:
    """One line for each constant of each certificate."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("certificates", nargs="+", type=Path)
    parser.add_argument("--boxes", type=int, default=2_000)
    parser.add_argument("--within", default="0.001", help="relative distance beyond the attained side")
    given = parser.parse_args()
    failed, step = False, Fraction(given.within)
    for path in given.certificates:
        document = read(path.read_text(encoding="utf-8"), str(path))
        case = Case(read_result(opened(document)[0]), given.boxes)
        for name in OVER_TUBE:
            rising = name == "lower"
            value = getattr(case.constants[name], "above" if rising else "below")
            if value is None or value <= 0:
                continue
            start = time.process_time()
            with ctx.workprec(64):
                found = bounded(case.place, name, value * (1 + step if rising else 1 - step), _LARGEST)
            verdict = "DISAGREE" if found.holds else found.verdict
            failed = failed or found.holds
            print(f"{path.stem:40} {name:20} {verdict:12} {time.process_time() - start:6.1f} s", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
