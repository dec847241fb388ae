"""Random changes of single fields of a certificate, its hash made right again, and which of them are harmless.

A change that still rechecks must be of a kind in `HARMLESS`: the field makes no claim, or the changed claim is itself
examined and true, and weaker (the safe direction is checked here, without the code under test).
"""

import copy
import json
import pickle
import random
import re
from collections import defaultdict

from rechecked import digest

from tubecert.errors import ExitCode, TubecertError
from tubecert.recheck.run import recheck

BUDGETS = 2_000, 20_000, 200_000


def anything(old, new):
    """The field makes no claim."""
    return True


def number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def same(old, new):
    """The same number, or the same written as a text."""
    return number(old) and ((number(new) and new == old) or (isinstance(new, str) and new == str(old)))


def lower(old, new):
    """A lower bound that claims less, or nothing."""
    return new is None or (number(new) and new <= old)


def higher(old, new):
    """An upper bound that claims less."""
    return new is None or (number(new) and new >= old)


def rounded_higher(old, new):
    """The same for a bound that is rounded up by more than this."""
    return new is None or (number(old) and higher(old * (1 - 1e-8), new))


def rounded_lower(old, new):
    """A bound from below that is rounded down by more than this."""
    return new is None or (number(old) and lower(old + 1e-8 * abs(old), new))


def not_certified(old, new):
    """What a section is called that does not decide, and is not certified: it claims nothing (and that is listed)."""
    return new in ("undecided", "refuted")


def verified(old, new):
    """Numbers of a point or pair or plan that are examined anew as they stand."""
    return number(new) or isinstance(new, str) or new is None


HARMLESS = [
    (r"reasons\[\]\.predictor_gain", anything),
    (r"reasons(\[\])?", anything),  # an explanation less
    (r"plan\.(curve|file|file_hash)\b.*", anything),
    (r"spec\.file_hash", anything),  # compared with the file itself by --spec
    # the sides of intervals that no claim uses; upper ends of margins
    (r"constants\.(?!lower\.)\w+\.below", anything),
    (r"constants\.lower\.above", anything),
    (r"conditions_26\.(least_adaptation\.)?margins\.26[abc]\[1\]", anything),
    (r"(distance\.\w+|no_adaptation)\.margin\[1\]", anything),
    (r"no_adaptation\.distance\[0\]", anything),
    (r"metric\.(margin|largest_rate|lower_on_set)\[1\]", anything),
    (r"metric\.(upper_on_set|unique_geodesics\.value)\[0\]", anything),
    # weaker claims, examined as they stand
    (r"conditions_26\.(least_adaptation\.)?margins\.26[abc]\[0\]", lower),
    (r"(distance\.\w+|no_adaptation)\.margin\[0\]", lower),
    (r"no_adaptation\.distance\[1\]", higher),
    (r"no_adaptation\.uncertainty_limit", lower),
    (r"metric\.(margin|largest_rate|lower_on_set)\[0\]", lower),
    (r"metric\.upper_on_set\[1\]", higher),
    (r"metric\.unique_geodesics\.value\[1\]", higher),
    (r"tube\.half_widths\.\w+", rounded_higher),
    (r"(\w+\.)+ultimate_radius", rounded_higher),  # or as small as the balls prove: rounding apart
    (r"constants\.\w+\.above", higher),
    # gains that are examined as they stand: another point that serves
    (r"conditions_26\.least_adaptation(\.\w+)?", verified),
    (r"distance\.(split|asked)(\.\w+)?", verified),
    (r"plan\.knots\.\w+\[\](\[\])?", verified),  # another plan, examined as it stands
    # a recipe may be any that serves
    (r"proof\.distance\.(speed|prediction_error|uncertainty)", verified),
    (r"(conditions_26|no_adaptation)\.verdict", not_certified),
    (r"decided_by\[\]", anything),  # any certified section may decide
    (r"overrides\b.*", anything),
    (r"(conditions_26|no_adaptation)\.shortfalls.*", anything),
    (r"clearance\[\]\.(t|inside|clearance\[1\])", anything),
    (r"clearance\[\]\.clearance\[0\]", verified),  # it is found to a thousandth of the width of the tube
    (r"inputs\[\]\.plan\.(least\[1\]|greatest\[0\])", anything),
    (r"inputs\[\]\.plan\.least\[0\]", lower),
    (r"inputs\[\]\.plan\.greatest\[1\]", higher),
    (r"inputs\[\]\.bounds\.\w+\.least", rounded_lower),
    (r"inputs\[\]\.bounds\.\w+\.(greatest|feedback|adaptation)", rounded_higher),
    (r"inputs\[\]\.bounds\.\w+", anything),  # of a kind that does not decide
    (r"clearance\[\]\.shape\.\w+\[\]", verified),
]
# geodesics of a constant metric are straight lines whatever is said of a test: the words of the assumption are the same
OF_CONSTANT_METRICS = [(r"metric\.unique_geodesics(\..*)?", anything)]
# gains of a section that is not certified claim nothing
OF_NO_RATES = [(r"conditions_26\.(bandwidth|adaptation_rate|projection_radius)", verified)]


def leaves(value, path=()):
    """Every field: paths to members of objects and lists, containers included."""
    members = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, member in members:
        yield (*path, key)
        yield from leaves(member, (*path, key))


def shape(path, *, indices=False):
    """A path as text; indices of lists are left out, except in pairs where `indices` asks for them."""
    text = ""
    for key in path:
        text += (f"[{key}]" if indices else "[]") if isinstance(key, int) else f".{key}"
    return text.lstrip(".")


def fields(result):
    """Paths by shape, so that long lists do not drown the rest."""
    found = defaultdict(list)
    for path in leaves(result):
        found[re.sub(r"constants\.\w+", "constants.*", shape(path))].append(path)
    return found


def changed(random_, value):
    """Another value for a field; `None` with the word `removed` takes it away."""
    if random_.random() < 0.15 or isinstance(value, (dict, list)):
        return "removed", None
    if isinstance(value, bool):
        return "changed", not value
    if number(value):
        return "changed", _other_number(random_, value)
    if isinstance(value, str):
        return "changed", _other_text(random_, value)
    return "changed", random_.choice([0.0, 1.0, "x", False])


def _other_number(random_, value):
    kind = random_.randrange(7)
    if kind == 0:
        return -value
    if kind == 1:
        return random_.choice([0, 1, 2, 1e9, 1e-9, -1.5])
    if kind == 2:
        return None
    if kind == 3:
        return str(value)
    size = 10.0 ** -random_.uniform(0, 10)
    return (value or 1.0) * (1 + random_.choice([-1, 1]) * size)


def _other_text(random_, value):
    kind = random_.randrange(4)
    if kind == 0 or not value:
        return random_.choice(["", "certified", "0", "refuted", "x"])
    place = random_.randrange(len(value))
    letter = random_.choice("0123456789.-+*xs ")
    if kind == 1:
        return value[:place] + letter + value[place + 1 :]
    if kind == 2:
        return value[:place] + value[place + 1 :]
    return value[:place] + letter + value[place:]


def applied(certificate, path, kind, value):
    """A copy with one field changed and the hash recomputed."""
    result = pickle.loads(pickle.dumps(certificate["result"]))
    holder = value_at(result, path[:-1])
    if kind == "removed":
        del holder[path[-1]]
    else:
        holder[path[-1]] = value
    return {**certificate, "hash": digest(result), "result": result}


def between_ends(result, path, new):
    """A bound of an enclosure moved inside it: the other end, which is attained, says that it may still be true."""
    *above, last = path
    other = {0: 1, 1: 0, "above": "below", "below": "above"}.get(last)
    holder = value_at(result, above)
    if other is None or not number(new):
        return False
    end = holder[other]
    return number(end) and min(end, holder[last]) <= new <= max(end, holder[last])


def is_harmless(result, path, old, new):
    names = {shape(path), shape(path, indices=True)}
    # an index matters in a pair only: [..][1] keeps its own name, other indices are dropped
    if path and isinstance(path[-1], int):
        names.add(f"{shape(path[:-1])}[{path[-1]}]")
    constant = all(re.fullmatch(r"[-+0-9.e/]+", e) for row in result["metric"]["dual_metric"] for e in row)
    rates = result.get("conditions_26")
    idle = OF_NO_RATES if rates is not None and rates["verdict"] != "certified" else []
    return same(old, new) or any(
        re.fullmatch(pattern, name)
        and (serves(old, new) or (serves in (lower, higher) and between_ends(result, path, new)))
        for name in names
        for pattern, serves in (*HARMLESS, *idle, *(OF_CONSTANT_METRICS if constant else ()))
    )


def confirming(certificate, memory):
    """The first budget with which the certificate is confirmed: where it is not, every change is refused for that."""
    for budget in BUDGETS:
        tried = {}
        if verdict_on(certificate, tried, budget) == ExitCode.CERTIFIED:
            memory |= tried
            return budget
    raise AssertionError("there is nothing to forge: it is not confirmed as it stands")


def verdict_on(certificate, memory, budget):
    """What recheck says: an exit code; findings of an invalid document count as their code."""
    try:
        found = recheck(json.dumps(certificate), "tampered", budget, memory=memory, to_first_failure=True)
    except TubecertError as error:
        return error.exit_code
    return found.exit_code


def campaign(certificate, count, seed, report=None):
    """`count` random changes: how many were refused, how many accepted by shape, and those that must not be.

    `report` is told every hundred changes how far it is.
    """
    random_, memory = random.Random(seed), {}
    shapes = fields(certificate["result"])
    names = sorted(shapes)
    refused, accepted, wrong = 0, defaultdict(int), []
    budget = confirming(certificate, memory)
    for done in range(count):
        if report is not None and done % 100 == 0:
            report(
                f"{done} changes: {refused} refused, {sum(accepted.values())} harmless, {len(wrong)} wrong {wrong[-3:]}"
            )
        path = random_.choice(shapes[random_.choice(names)])
        old = value_at(certificate["result"], path)
        kind, new = changed(random_, old)
        if kind == "changed" and type(new) is type(old) and new == old:
            continue
        code = verdict_on(applied(certificate, path, kind, new), memory, budget)
        assert code in (ExitCode.CERTIFIED, ExitCode.NOT_CERTIFIED, ExitCode.INVALID, ExitCode.UNDECIDED)
        if code != ExitCode.CERTIFIED:
            refused += 1
            continue
        accepted[shape(path)] += 1
        if not is_harmless(certificate["result"], path, old, new):
            wrong.append((shape(path, indices=True), kind, old, new))
    return refused, dict(accepted), wrong


# -- changes of structure: keys removed, added, renamed, moved; types; extreme numbers; names of other kinds

STRUCTURES = (
    "removed", "added", "renamed", "moved", "swapped", "retyped", "wrapped", "listed", "extreme", "named",
)  # fmt: skip
EXTREME = [
    "1e-999999999", "1e999999999", "1e308", "-1e308", "5e-324", "-0.0", "9" * 4000, "0." + "3" * 4000,
    "0.1000000000000000055511151231257827", "1E400", "00", "1.", '"1e-999999999"', '"9**9**9"', '"12**12**12"',
    f'"{"9" * 4000}"', '"1/0"', '"nan"', '"Infinity"', '"\\u0661"', '"1_0"', '"0x10"', "NaN", "-Infinity",
]  # fmt: skip
BAD_NAMES = ("pi", "t", "True", "None", "sin", "abs", "lambda", "e 1", "1e5", "", "x*", "\u03c0", "mu#", "s#")

# members that may be there or not, wherever they come from: they make no claim, or are examined as they stand
MAY_BE_ADDED = [
    r"spec\.effective\.system\.(units|parameters)\.\w+",
    r"spec\.effective\.(expect|simulation|obstacles)",
    r"overrides\.\w+",
    r"reasons\[\]\.predictor_gain",
    r"(notes|run)\b.*",
]


def another_name(old, new):
    """An input of another name: inputs enter through the columns of B, and occur nowhere else."""
    return isinstance(new, str) and re.fullmatch(r"[A-Za-z]\w{0,39}", new) and new not in BAD_NAMES


OF_STRUCTURE = [
    (r"spec\.effective\.system\.inputs\[\]", another_name),
    (r"spec\.effective\.(name|expect|simulation|obstacles)\b.*", anything),
    (r"spec\.effective\.system\.(units|parameters)\b.*", anything),
    (r"spec\.effective\.trajectory\.(Q|R|knots|file)\b.*", anything),  # how the plan was found
    (r"(reasons|decided_by)\[\]", anything),
]


def allowed(result, path, old, new):
    """Whether a member may be changed so (new None: removed), or is harmless as a single field is."""
    return is_harmless(result, path, old, new) or any(
        re.fullmatch(pattern, shape(path)) and serves(old, new) for pattern, serves in OF_STRUCTURE
    )


def may_be_added(path):
    return any(re.fullmatch(pattern, shape(path)) for pattern in MAY_BE_ADDED)


def value_at(result, path):
    for key in path:
        result = result[key]
    return result


def restructured(random_, original, kind, shapes):
    """(a result of another structure, the paths that were changed with their old and new values).

    `shapes` are the fields of the original.
    """
    result = pickle.loads(pickle.dumps(original))  # a copy, in a third of the time of `deepcopy`
    names = sorted(shapes)

    def some(accepts=lambda value: True):
        for _ in range(200):
            path = random_.choice(shapes[random_.choice(names)])
            if accepts(value_at(original, path)):
                return path
        return None

    path = some()
    if kind in ("swapped", "added"):
        path = some(lambda value: isinstance(value, dict) and len(value) > 1)
    if kind in ("removed", "renamed", "moved"):
        while isinstance(path[-1], int):
            path = some()
    if kind == "listed":
        path = some(lambda value: isinstance(value, list) and value)
    if kind == "extreme":
        path = some(
            lambda value: number(value) or (isinstance(value, str) and re.fullmatch(r"-?[\d./]+", value))
        )
    old = copy.deepcopy(value_at(original, path))
    holder, key = value_at(result, path[:-1]), path[-1]
    if kind == "removed":
        del holder[key]
        return result, [("removed", path, old, None)]
    if kind == "added":
        inner = holder[key]
        name = random_.choice([*_keys(shapes), "u_max", "torque", "", "Horizon", "verdict ", "__class__"])
        if name in inner:
            return None
        value = (
            copy.deepcopy(value_at(original, some()))
            if random_.random() < 0.7
            else random_.choice([1.0, "1", None, {}, []])
        )
        inner[name] = value
        return result, [("added", (*path, name), None, value)]
    if kind == "renamed":
        name = random_.choice([*_keys(shapes), key.upper(), f"{key} ", f"{key}s"])
        if name in holder:
            return None
        holder[name] = holder.pop(key)
        return result, [("removed", path, old, None), ("added", (*path[:-1], name), None, old)]
    if kind == "moved":
        target = some(lambda value: isinstance(value, dict))
        if target[: len(path)] == path or key in value_at(result, target):
            return None
        value_at(result, target)[key] = holder.pop(key)
        return result, [("removed", path, old, None), ("added", (*target, key), None, old)]
    if kind == "swapped":
        inner = holder[key]
        one, two = random_.sample(sorted(inner), 2)
        if inner[one] == inner[two]:
            return None
        inner[one], inner[two] = inner[two], inner[one]
        return result, [("changed", (*path, k), inner[o], inner[k]) for k, o in ((one, two), (two, one))]
    if kind == "retyped":
        holder[key] = random_.choice(
            [0, 1.0, "", "certified", True, False, None, [], {}, [old], {"x": old}, str(old)]
        )
    elif kind == "wrapped":
        holder[key] = random_.choice([[old], {"value": old}, [old, old]])
    elif kind == "listed":
        items, place = holder[key], random_.randrange(len(old))
        how = random_.randrange(3)
        if how == 0:
            del items[place]
        elif how == 1:
            items.insert(place, copy.deepcopy(items[place]))
        else:
            random_.shuffle(items)
        if items == old:
            return None
        return result, [("listed", (*path, 0), old, items)]
    elif kind == "extreme":
        holder[key] = "@extreme@"
    elif kind == "named":
        return _named(random_, result)
    return result, [("changed", path, old, holder[key])]


def _keys(shapes):
    """Every key of an original."""
    return sorted({path[-1] for group in shapes.values() for path in group if isinstance(path[-1], str)})


def _named(random_, result):
    """A state or an input renamed everywhere, to a name of its own or to one that means something else."""
    system = result["spec"]["effective"]["system"]
    old = random_.choice([*system["states"], *system["inputs"]])
    good = random_.random() < 0.2
    new = "zeta" if good else random_.choice([*BAD_NAMES, *system["states"], *system["inputs"]])
    if new == old:
        return None
    text = re.sub(rf"(?<![\w]){re.escape(old)}(?![\w])", new.replace("\\", ""), json.dumps(result))
    try:
        return json.loads(text), [("named", ("names", "good" if good else "bad"), old, new)]
    except ValueError:
        return None


def resealed(certificate, result, random_):
    """The text of a certificate with both hashes made right."""
    inner = result.get("spec") if isinstance(result, dict) else None
    if isinstance(inner, dict) and isinstance(inner.get("effective_hash"), str) and "effective" in inner:
        inner["effective_hash"] = digest(inner["effective"])
    text = json.dumps({**certificate, "hash": digest(result), "result": result})
    return text.replace('"@extreme@"', random_.choice(EXTREME))


def structural_campaign(certificate, count, seed, report=None):
    """`count` changes of structure: refused, accepted by kind and shape, and those that must not be (or crash)."""
    random_, memory = random.Random(seed), {}
    refused, accepted, wrong, done = 0, defaultdict(int), [], 0
    budget = confirming(certificate, memory)
    same, shapes = json.dumps(certificate["result"]), fields(certificate["result"])
    while done < count:
        kind = STRUCTURES[done % len(STRUCTURES)]
        made = restructured(random_, certificate["result"], kind, shapes)
        if made is None:
            continue
        result, changes = made
        text = resealed(certificate, result, random_)
        if json.dumps(result) == same:
            continue  # a hash that is made right again, a text for a text
        done += 1
        if report is not None and done % 100 == 0:
            report(
                f"{done} changes: {refused} refused, {sum(accepted.values())} harmless, {len(wrong)} wrong"
            )
        try:
            code = recheck(text, "tampered", budget, memory=memory, to_first_failure=True).exit_code
        except TubecertError as error:
            code = error.exit_code
        except Exception as error:  # an internal error is a finding too
            wrong.append(("crash", kind, repr(error)[:100], [shape(path) for _, path, _, _ in changes]))
            continue
        if code != ExitCode.CERTIFIED:
            refused += 1
            continue
        accepted[kind, shape(changes[0][1])] += 1
        left = [
            change for change in changes if change[0] != "changed" or value_at(result, change[1]) != change[2]
        ]
        # a hash is made right again
        if not all(_harmless_change(certificate["result"], *change) for change in left):
            wrong.append(
                (kind, [(shape(path), str(old)[:40], str(new)[:40]) for _, path, old, new in changes])
            )
    return refused, dict(accepted), wrong


def _harmless_change(result, how, path, old, new):
    if how == "added":
        return may_be_added(path)
    if how == "named":
        return path[-1] == "good"
    return allowed(result, path, old, new)
