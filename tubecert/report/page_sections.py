"""A certificate as a page: which sections there are, and what each one says.

In: the certificate as data. Out: a `Page`. Numbers are shown as in the console's report: bounds from above rounded up,
bounds from below rounded down.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from tubecert.bounds.constants import DERIVED, TABLE
from tubecert.report import console, sections
from tubecert.report.figures_gains import gain_figures
from tubecert.report.figures_tube import places, suprema_figures, tube_figures
from tubecert.report.gains import NAMES, deciding, rows
from tubecert.report.numbers import UNKNOWN, down, exact, short, up
from tubecert.report.page import (
    Block,
    Cell,
    Facts,
    Figures,
    Items,
    Page,
    Reason,
    Section,
    Table,
    Tile,
    Words,
)
from tubecert.report.page_conditions import conditions
from tubecert.report.page_origin import check_again, provenance, system
from tubecert.report.page_trust import declared, proven
from tubecert.report.reasons import assumption_of, reason_of
from tubecert.words.advice import advice
from tubecert.words.claims import message, title

_TUBE = (
    "The tube projected on each plane: the state is within rho of the plan in the Euclidean norm, and each coordinate "
    "within its half-width."
)


def page_of(certificate: Mapping[str, Any]) -> Page:
    """The page of a certificate, whatever its verdict; the same before it is written and after it is read back."""
    certificate = json.loads(json.dumps(certificate, sort_keys=True))
    result = certificate["result"]
    line = console.verdict_line(result).plain
    return Page(
        name=console.name(result),
        verdict=result["verdict"],
        summary=line.partition(": ")[2],
        meaning=console.meaning(result).plain,
        tiles=tuple(_tiles(result)),
        sections=tuple(_sections(certificate)),
    )


def _tiles(result: Mapping[str, Any]) -> Iterator[Tile]:
    """The numbers that a certified verdict is about; other verdicts have none to rely on."""
    if result["verdict"] != "certified":
        return
    yield Tile(symbol="ρ", value=up(result["tube"]["rho"]), unit="", words="radius of the tube")
    chosen = deciding(result)
    for row in chosen:
        who = f", {NAMES[row.section]}" if len(chosen) > 1 else ""
        yield Tile(symbol="ω", value=exact(row.bandwidth), unit="rad/s", words=f"filter bandwidth{who}")
        if row.adaptation_rate is not None:
            yield Tile(symbol="Γ", value=exact(row.adaptation_rate), unit="", words=f"adaptation rate{who}")
        if row.sample_time is not None:
            yield Tile(symbol="Ts", value=exact(row.sample_time), unit="s", words=f"sample time{who}")


def _sections(certificate: Mapping[str, Any]) -> Iterator[Section]:
    result = certificate["result"]
    if reasons := _reasons(result, certified=False):
        yield Section(key="why", title="Not certified", blocks=reasons)
    if any(name in result for name in NAMES):
        yield Section(key="gains", title="Gains", blocks=tuple(_gains(result)))
    if blocks := tuple(_tube(result)):
        yield Section(key="tube", title="Tube" if "tube" in result else "Safe set", blocks=blocks)
    if any(name in result for name in NAMES):
        yield Section(key="conditions", title="Conditions and margins", blocks=tuple(_conditions(result)))
    yield Section(key="rests-on", title="What this rests on", blocks=tuple(_rests_on(result)))
    if "metric" in result:
        yield Section(key="metric", title="Metric", blocks=tuple(_metric(result["metric"])))
    if "constants" in result:
        yield Section(key="constants", title="Constants over the tube", blocks=tuple(_constants(result)))
    yield Section(key="system", title="The specification", blocks=tuple(system(result)))
    yield Section(key="provenance", title="Provenance", blocks=tuple(provenance(certificate)))
    yield Section(key="check", title="Check it again", blocks=tuple(check_again(certificate)))


def _reasons(result: Mapping[str, Any], *, certified: bool) -> tuple[Block, ...]:
    return tuple(
        Reason(
            verdict=reason.get("verdict", "undecided"),
            claim=title(told.claim),
            message=message(told),
            at=sections.point(result, reason["at"]) if reason.get("at") else "",
            relax=advice(told.relax),
        )
        for reason, told in ((reason, reason_of(reason)) for reason in result["reasons"])
        if (reason.get("verdict") == "certified") is certified
    )


def _gains(result: Mapping[str, Any]) -> Iterator[Block]:
    found = list(rows(result))
    if found:
        columns = ("certificate", "gains", "verdict", "ω (rad/s)", "Γ", "Ts (s)", "margin left")
        note = "* decides the verdict. Rows do not mix: each set of gains was proven by itself."
        decided = any(row.decides for row in found)
        yield Table(columns=columns, rows=tuple(map(_gains_row, found)), note=note if decided else "")
    if missing := [NAMES[key] for key in NAMES if key in result and all(r.section != key for r in found)]:
        yield Words(text=f"No gains were found for {', '.join(missing)}.")
    if (limit := result.get("sampled", {}).get("sample_time_limit")) is not None:
        yield Words(text=f"However large the bandwidth, C needs a sample time below {down(limit)} s.")
    yield from _reasons(result, certified=True)
    curves = tuple(f for f in gain_figures(result) if not f.key.startswith(("margins", "elasticities")))
    if curves:
        yield Figures(figures=curves)


def _gains_row(row: Any) -> tuple[Cell, ...]:
    return (
        Cell(text=NAMES[row.section]),
        Cell(text=f"{row.which} *" if row.decides else row.which),
        Cell(text=row.verdict, kind="verdict"),
        Cell(text=exact(row.bandwidth), kind="number"),
        Cell(text="" if row.adaptation_rate is None else exact(row.adaptation_rate), kind="number"),
        Cell(text="" if row.sample_time is None else exact(row.sample_time), kind="number"),
        Cell(text=row.slack, kind="number"),
    )


def _conditions(result: Mapping[str, Any]) -> Iterator[Block]:
    yield from conditions(result)
    figures = tuple(f for f in gain_figures(result) if f.key.startswith(("margins", "elasticities")))
    if figures:
        yield Figures(figures=figures)


def _tube(result: Mapping[str, Any]) -> Iterator[Block]:
    if "tube" in result:
        yield Facts(facts=tuple(_radii(result)))
    figures = tuple(tube_figures(result))
    if figures:
        yield Figures(figures=figures)
        if "half_widths" in result.get("tube", {}):
            yield Words(text=_TUBE)


def _radii(result: Mapping[str, Any]) -> Iterator[tuple[str, Cell]]:
    tube = result["tube"]
    rho = up(tube["rho"])
    if "rho_r" in tube:
        rho += f" = {up(tube['rho_r'])} (rho_r) + {up(tube['rho_a'])} (rho_a)"
    yield "radius rho", Cell(text=rho)
    yield "epsilon", Cell(text=short(tube["epsilon"]))
    system = result["spec"]["effective"]["system"]
    units = system.get("units", {})
    if widths := tube.get("half_widths"):
        sides = (f"{name} {up(widths[name])} {units.get(name, '')}".strip() for name in system["states"])
        yield "half-widths", Cell(text=", ".join(sides))
    yield "claimed", Cell(text=sections.span(result))
    if sections.horizon(result) is None:
        for section, title in NAMES.items():
            data = result.get(section, {})
            if data.get("verdict") == "certified" and data.get("ultimate_radius") is not None:
                yield f"in the long run, {title}", Cell(text=f"|x - x*| <= {up(data['ultimate_radius'])}")


def _rests_on(result: Mapping[str, Any]) -> Iterator[Block]:
    yield Items(title="Proven", items=tuple(proven(result)) or ("nothing that could be relied on",))
    yield Items(title="Declared, believed as given", items=tuple(declared(result)) or ("nothing",))
    yield Items(title="Assumed, not proven", items=tuple(map(assumption_of, result["assumptions"])))


def _metric(metric: Mapping[str, Any]) -> Iterator[Block]:
    facts = [
        ("verdict", Cell(text=metric["verdict"], kind="verdict")),
        ("rate", Cell(text=f"{exact(metric['rate'])} 1/s")),
    ]
    if metric.get("largest_rate") is not None:
        facts.append(("supports rates up to", Cell(text=f"{down(metric['largest_rate'][0], 7)} 1/s")))
    for words, low, high in (
        ("over the tube", "lower", "upper"),
        ("on the safe set", "lower_on_set", "upper_on_set"),
    ):
        if low in metric and high in metric:
            a, A = metric[low][0], metric[high][1]
            facts.append((words, Cell(text=f"{down(a)} I <= M <= {up(A)} I")))
    for i, row in enumerate(metric["dual_metric"]):
        for j, entry in enumerate(row[i:], start=i):
            facts.append((f"W[{i + 1},{j + 1}]", Cell(text=entry, kind="code")))
    yield Facts(facts=tuple(facts))
    yield Words(text="W is the dual metric, the inverse of M; it is symmetric.")


def _constants(result: Mapping[str, Any]) -> Iterator[Block]:
    figures = tuple(suprema_figures(result))
    if figures:
        yield Words(
            text="Where in the tube, with all of its radius, each constant was found largest or smallest:"
        )
        yield Figures(figures=figures, places=places(result))
    yield Table(
        columns=("symbol", "meaning", "proven", "unit", "equation", "gap"),
        rows=tuple(
            _constant(result, name, result["constants"][name]) for name in _order(result["constants"])
        ),
        note="The proven side is the one that the conditions use. The gap is how far both proven sides are apart. "
        "In units, x and u stand for the units of states and inputs, d for Riemannian distance.",
    )


def _order(constants: Mapping[str, Any]) -> list[str]:
    """The constants of the paper first, then what follows from them, each in the order of its table."""
    known = {name: i for i, name in enumerate([*TABLE, *DERIVED])}
    return sorted(constants, key=lambda name: (known.get(name, len(known)), name))


def _constant(result: Mapping[str, Any], name: str, item: Mapping[str, Any]) -> tuple[Cell, ...]:
    at = sections.point(result, item["at"]) if item.get("at") else ""
    return (
        Cell(text=item["symbol"], kind="code"),
        Cell(text=sections.described(name), note=f"at {at}" if at else ""),
        Cell(text=sections.proven(name, item), kind="number"),
        Cell(text=item["unit"] if item["unit"] != "1" else UNKNOWN),
        Cell(text=item["equation"]),
        Cell(text=sections.gap(item), kind="number"),
    )
