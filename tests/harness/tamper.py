"""Random changes of the shipped certificates, hashes made right: none may recheck unless it is harmless.

    python tests/harness/tamper.py --count 10000 configs/three_state.yaml configs/two_state.yaml
    python tests/harness/tamper.py --structural --count 2000 configs/three_state.yaml configs/two_state.yaml

Without `--structural` single fields are changed; with it keys are removed, added, renamed and moved, members swapped,
types changed, numbers written in extreme ways, states and inputs renamed.

The kinds of harmless changes are listed in `tests/tampers.py` and in docs/recheck.md. Exit code 1 if another kind was
accepted. Outcomes of claims that a change does not touch are kept, so that a change costs what it touches.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import tampers  # noqa: E402

from tubecert import certificate, pipeline, spec  # noqa: E402
from tubecert.verdict import Verdict  # noqa: E402


def certified(path: str) -> dict[str, object]:
    """The certificate of a specification, as it is written and read: of all kinds, if all are certified."""
    read = spec.load(path)
    found = pipeline.certify(read, pipeline.Options(conditions="all"))
    if found.verdict is not Verdict.CERTIFIED:  # every change of it would be refused, for that alone
        found = pipeline.certify(read, pipeline.Options())
    assert found.verdict is Verdict.CERTIFIED, f"{path} is not certified, and there is nothing to forge"
    result = found.to_json()
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "certificate.json"
        certificate.write(str(target), certificate.seal(result, {}))
        return json.loads(target.read_text(encoding="utf-8"))


def main() -> int:
    """Run the campaign on each specification."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("specs", nargs="+")
    parser.add_argument("--count", type=int, default=10_000, help="changes, shared evenly")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--structural", action="store_true", help="change the structure, not single fields")
    given = parser.parse_args()
    failed = False
    for path in given.specs:
        start = time.perf_counter()
        campaign = tampers.structural_campaign if given.structural else tampers.campaign
        refused, accepted, wrong = campaign(
            certified(path),
            given.count // len(given.specs),
            given.seed,
            lambda text, path=path: print(f"{path}: {text}", file=sys.stderr, flush=True),
        )
        seconds = time.perf_counter() - start
        print(
            f"{path}: {refused} refused, {sum(accepted.values())} harmless, {len(wrong)} wrong, {seconds:.0f} s"
        )
        for name, count in sorted(accepted.items(), key=lambda item: -item[1]):
            print(f"  accepted {count:5}  {' '.join(name) if given.structural else name}")
        for case in wrong:
            print(f"  WRONG {case}")
        sys.stdout.flush()
        failed = failed or bool(wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
