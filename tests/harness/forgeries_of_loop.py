"""Forged certificates of sampled loops, hashes made right: what is confirmed must be true all the same.

    python tests/harness/forgeries_of_loop.py --count 1500 --seed 34

What `recheck` confirms must differ only in what steers the check, or be proven by the producer's theorem, which shares
nothing with the checker. Bounds of the checker may be sharper (remainders, rounding by stage): proven but for .5 % of
the tube is enough if adversaries do not falsify it. All else is UNEXPLAINED, and the exit code is 1.
"""

import argparse
import copy
import json
import random
import re
import sys
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

import numpy as np
from mutants_of_loop import ROOT, certificate_text, certify, files, load, load_text

import tampers  # isort: skip

from tubecert.recheck.document import CertificateError
from tubecert.recheck.grammar import spelled
from tubecert.recheck.run import recheck
from tubecert.sampled_loop.record import Claim, of_json
from tubecert.sampled_loop.theorem import check
from tubecert.simulation.sampled.campaign import simulate
from tubecert.simulation.sampled.setting import setting_of
from tubecert.spec import canonical
from tubecert.verdict import Verdict

HOW_OFTEN = {  # what is dear is forged seldom
    **{"SCALAR": 4, "CART": 4, "SWING": 4, "FAMILY": 4, "FAR": 2, "PAIR": 4, "three": 8, "car_family": 6},
    **{"state_dependent_input": 4, "two_state_plan": 4, "orbit": 4, "rest": 2, "two_state_family": 0.5},
    **{"pvtol": 0.5, "pvtol_moving": 0.5, "pvtol_mass": 0.5, "pvtol_family": 0.5},
}
FACTORS = (1.03, 0.98, 0.5, 2, 1.001, 0.999, -1, 0)
NUMBER, HEX = re.compile(r"-?\d+(\.\d+|/\d+)?(e-?\d+)?"), re.compile(r"-?0x[\da-f.]+p[-+]\d+")
CYCLES = "nothing rest repeat nothing; middle left continuous middle; slow sudden slow; auto none auto"
CYCLES += "; single double single; hold linear hold; true false true; certified undecided certified"
WORDS = {a: b for cycle in CYCLES.split("; ") for a, b in zip(cycle.split(), cycle.split()[1:], strict=False)}


def other(draw, value, factor):
    """Another number, word or text of the same kind."""
    if isinstance(value, int):
        return max(0, draw.choice([value - 1, value + 1, value // 2, 2 * value]))
    if isinstance(value, float):
        return float(f"{value * factor:.12g}")
    if not isinstance(value, str):
        return 1
    if HEX.fullmatch(value):
        x = np.float32(float.fromhex(value))
        return float(draw.choice([np.float32(factor * x), np.nextafter(x, np.float32(9))])).hex()
    if NUMBER.fullmatch(value):
        return spelled(Fraction(value) * Fraction(str(factor)))
    return WORDS.get(value, f"{factor}*({value})")


def field(pattern, factors=FACTORS):
    """A forger of a field whose path is like this, every shape as often."""

    def forger(draw, result, _):
        paths = [draw.choice(own) for name, own in tampers.fields(result).items() if re.match(pattern, name)]
        plain = [own for own in paths if not isinstance(tampers.value_at(result, own), (dict, list))]
        if plain:
            *above, last = draw.choice(plain)
            holder = tampers.value_at(result, above)
            holder[last] = other(draw, holder[last], draw.choice(factors))

    return forger


def tables(draw, result, _):
    """Rows or columns moved or turned around, or all entries scaled."""
    own = draw.choice([own for own in result["controller"].values() if own["columns"] and own["rows"]])
    rows, factor = own["rows"], draw.choice(FACTORS)
    scaled = [[float(np.float32(factor * float.fromhex(e))).hex() for e in row] for row in rows]
    turned = (
        [list(column) for column in zip(*rows, strict=True)] if len(rows) == own["columns"] else rows[::-1]
    )
    own["rows"] = draw.choice([scaled, turned, [*rows[1:], rows[0]], [[*row[1:], row[0]] for row in rows]])


def stages(draw, result, _):
    """Some of them, from when others begin."""
    tube = result["tube"]
    count = draw.randint(1, len(tube))
    of, begin = (sorted(draw.sample(range(len(tube)), count)) for _ in "12")
    result["tube"] = [{**tube[i], "start": tube[j]["start"]} for i, j in zip(of, begin, strict=True)]
    result["tube"][0]["start"] = 0


def sections(draw, result, every):
    """Of another certificate."""
    foreign, keys = draw.choice(every), draw.sample(sorted(result), draw.randint(1, 4))
    result |= {key: copy.deepcopy(foreign[key]) for key in keys if key in foreign}


def harder(draw, result, every):
    """More of what acts; later, by a sample or a tenth of one; wider ranges of parameters."""
    own, how = result["spec"]["effective"], draw.randrange(6)
    machine, known = own["hardware"], own["system"]["parameters"]
    if how == 0 and machine["delay"] != "one sample":
        more = Fraction(machine["sample_time"]) / draw.choice((1, 10))
        machine["delay"] = spelled(Fraction(machine["delay"]) + more)
    elif how == 1:
        for name in (name for name, ends in known.items() if isinstance(ends, list)):
            a, b = map(Fraction, known[name])
            known[name] = [spelled(a - (b - a) / draw.choice((2, 40))), spelled(b)]
    else:
        acts = r"hardware|disturbance\.(bound|rate)|initial_state|uncertainty|trajectory\.(defect|input_rate|x|u)"
        field(acts, (1.03, 1.5, 2))(draw, own, every)


KINDS = {
    "numbers": (field(r"(?!spec|planned|controller)"), 4), "question": (field(r"planned|spec\.effective\."), 7),
    "entries": (field(r"controller\.\w\.rows"), 4), "narrower": (field(r"tube|inputs", (0.999, 0.98, 0.9)), 4),
    "tables": (tables, 3), "stages": (stages, 2), "sections": (sections, 2), "structure": (None, 4),
    "harder": (harder, 5),
}  # fmt: skip


def consistent(result):
    """The specification in its canonical form, and what repeats it."""
    own = canonical(load_text(json.dumps(result["spec"]["effective"])))
    after, until = own["trajectory"].get("afterwards", "nothing"), own["trajectory"].get("horizon")
    until = float(Fraction(until)) if until and after == "nothing" else None
    result["claim"] = {"afterwards": after, "hold": own["hardware"]["hold"], "horizon": until}
    result["spec"]["effective"], limits = own, own.get("limits", {})
    for use in result["inputs"]:
        if use.pop("limits", None) and use["input"] in limits:
            use["limits"] = [float(Fraction(end)) for end in limits[use["input"]]]


def forged(draw, document, kind, every):
    """The text of a certificate that was changed; "" if nothing was."""
    result = copy.deepcopy(document["result"])
    if kind == "structure":
        made = tampers.restructured(draw, result, draw.choice(tampers.STRUCTURES), tampers.fields(result))
        return "" if made is None else tampers.resealed(document, made[0], draw)
    KINDS[kind][0](draw, result, every)
    if result["spec"] != document["result"]["spec"] and draw.random() < 0.8:
        with suppress(Exception):  # of what is no specification nothing can be made right
            consistent(result)
    return json.dumps(files.resealed({**document, "result": result})) if result != document["result"] else ""


def why_true(document, before):
    """The rule by which a confirmed forgery is true; UNEXPLAINED without one."""
    said = document["result"]
    if {**said, "recipe": 0, "nominal": 0} == {**before, "recipe": 0, "nominal": 0}:
        return "steers the check"
    wider = json.loads(json.dumps(said["tube"]), parse_float=lambda text: 1.005 * float(text))
    tubes = ({**document, "result": {**said, "tube": tube}} for tube in (said["tube"], wider))
    result, loose = (of_json(own, "forged").result for own in tubes)
    effective = {**said["spec"]["effective"], "name": "forged"}
    effective.pop("expect", None)  # what is expected is not claimed
    own = setting_of(load_text(json.dumps(effective)), result)
    finer = replace(result.recipe, pieces=32, panels=32, windows=1024)
    claim = Claim(horizon=own.loop.horizon, afterwards=own.loop.afterwards, hold=own.loop.hold)
    inputs = ()
    for tube, recipe in ((result.tube, result.recipe), (result.tube, finer), (loose.tube, finer)):
        found = check(own.loop, own.tables, tube, recipe)
        inputs = inputs if tube is loose.tube else found.inputs
        agrees = result.claim == claim and result.clearance == found.clearance
        agrees &= all(serves(*each) for each in zip(result.inputs, inputs, strict=True))
        if agrees and found.verdict is Verdict.CERTIFIED:
            near = tube is loose.tube
            falsified = near and simulate(own, "", runs=50, seed=1).outcome == "falsified"
            return "FALSIFIED" if falsified else "proven but for .5 %" if near else "proven"
    return "UNEXPLAINED"


def serves(use, one):
    """Whether a range that is claimed holds one that is proven, to 7 digits, and its limits are the same."""
    near = max(map(abs, one.range)) / 500_000
    inside = use.range[0] <= one.range[0] + near and one.range[1] - near <= use.range[1]
    return inside and (use.input, use.limits) == (one.input, one.limits)


def said_of(text, before):
    """What `recheck` says of a certificate; of one that is confirmed, why it is true."""
    try:
        found = recheck(text, "forged", seconds=120, to_first_failure=True)
        why = found.verdict if found.stated == "certified" else "not certified"
        return why_true(json.loads(text), before["result"]) if why == "confirmed" else why
    except CertificateError:
        return "unread"
    except Exception as error:
        return f"CRASH {error!r:.80}"


def main():
    """Forge, examine, count; tell all that is confirmed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=34)
    parser.add_argument("--only", nargs="*", default=list(HOW_OFTEN), help="certificates")
    given, every, table = parser.parse_args(), {}, Counter()
    for name in given.only:
        shipped = None if name.isupper() else certify(load(f"{ROOT}/configs/hardware_{name}.yaml"))
        every[name] = json.loads(certificate_text(shipped)) if shipped else files.made(getattr(files, name))
    draw, results = random.Random(given.seed), [own["result"] for own in every.values()]
    while table.total() < given.count:
        (name,) = draw.choices(given.only, [HOW_OFTEN[own] for own in given.only])
        (kind,) = draw.choices(list(KINDS), [weight for _, weight in KINDS.values()])
        if text := forged(draw, every[name], kind, results):
            table[kind, said := said_of(text, every[name])] += 1
            if said not in ("unread", "contradicted", "undecided", "not certified"):
                print(table.total(), name, kind, said, flush=True)
    for (kind, said), count in sorted(table.items()):
        print(f"{kind:10} {count:5} {said}")
    return int(any(said[:2].isupper() for _, said in table))


if __name__ == "__main__":
    sys.exit(main())
