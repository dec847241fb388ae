"""What is stated of obstacles is proven again; planted faults are refused."""

import copy
from fractions import Fraction

import pytest
import yaml
from rechecked import certified, doubted, examine, failing, respecified, sealed, unconfirmed
from systems import SMALL
from texts import CONFIGS

from tubecert.recheck.clearances import _square, _turned
from tubecert.recheck.obstacles import Shape, is_simple

ORBIT = (CONFIGS / "two_state_orbit.yaml").read_text("utf-8")
CLEAR = [
    {"states": ["x1", "x2"], "disc": {"center": [3, 0], "radius": "0.4"}},
    {"states": ["x2", "x1"], "polygon": [[2, -1], [3, -1], [3, 1], ["2.5", 0]]},
]
MET = [{"states": ["x1", "x2"], "disc": {"center": [1, 1], "radius": "0.3"}}]


def with_obstacles(obstacles):
    return ORBIT + yaml.safe_dump({"obstacles": obstacles})


@pytest.fixture(scope="module")
def clear():
    return certified(with_obstacles(CLEAR), conditions="distance")


@pytest.mark.slow
def test_clearance_is_confirmed(clear):
    result = clear["result"]
    assert result["verdict"] == "certified"
    assert [own["verdict"] for own in result["clearance"]] == ["certified", "certified"]
    assert not failing(examine(clear))


def grow(result, by=1.01):  # it was found to a thousandth of the width of the tube
    low, high = result["clearance"][0]["clearance"]
    result["clearance"][0]["clearance"] = [low * by, high * by]


def ends_early(clearance):
    clearance[1] = clearance[0] / 2


FAULTS = {
    "a larger clearance": grow,
    "a thinner tube": lambda r: r["clearance"][0]["shape"].update(
        diagonal=[0.999 * v for v in r["clearance"][0]["shape"]["diagonal"]]
    ),
    "a tube turned": lambda r: r["clearance"][0]["shape"].update(
        beside=[-v for v in reversed(r["clearance"][0]["shape"]["beside"])]
    ),
    "an entry removed": lambda r: r["clearance"].pop(),
    "the list removed": lambda r: r.pop("clearance"),
    "entries exchanged": lambda r: r["clearance"].reverse(),
    "no clearance": lambda r: r["clearance"][0].update(clearance=[0.0, 1.0]),
    "a clearance that ends before it begins": lambda r: ends_early(r["clearance"][0]["clearance"]),
    "another verdict": lambda r: r["clearance"][0].update(verdict="undecided"),
    "it does not decide": lambda r: r["clearance"][0].update(decides=False, verdict="undecided"),
    "an unknown member": lambda r: r["clearance"][0].update(obstacle=1),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_refused(clear, fault):
    forged = copy.deepcopy(clear)
    FAULTS[fault](forged["result"])
    assert unconfirmed(forged)


SQUARE = [["-6", "-6"], ["6", "-6"], ["6", "6"], ["-6", "6"]]
MOVES = {
    "nearer": lambda s: s["obstacles"][0]["disc"].update(center=["2.5", "0"]),
    "larger": lambda s: s["obstacles"][0]["disc"].update(radius="0.9"),
    "around the plan": lambda s: s["obstacles"][1].update(polygon=SQUARE),
    "around the plan, listed twice": lambda s: s["obstacles"][1].update(polygon=SQUARE * 2),
    "in another plane": lambda s: s["obstacles"][0].update(
        states=["x2", "x1"], disc={"center": ["1", "1"], "radius": "1"}
    ),
    "in no plane": lambda s: s["obstacles"][0].update(states=["x1", "x1"]),
    "of no size": lambda s: s["obstacles"][0]["disc"].update(radius="0"),
    "of less than no size": lambda s: s["obstacles"][0]["disc"].update(radius="-1/10"),
    "one more": lambda s: s["obstacles"].append(s["obstacles"][0]),
}


@pytest.mark.slow
@pytest.mark.parametrize("move", MOVES)
def test_an_obstacle_elsewhere_is_noticed(clear, move):
    assert unconfirmed(respecified(clear, MOVES[move]))


@pytest.mark.slow
def test_an_obstacle_that_is_met_refutes_unless_it_does_not_decide():
    met = certified(with_obstacles(MET), conditions="distance")["result"]
    assert met["verdict"] == "refuted"
    assert met["distance"]["verdict"] == "certified"
    assert met["reasons"][-1]["claim"] == "obstacle_cleared"
    told = certified(with_obstacles([{**MET[0], "decide": False}]), conditions="distance")
    assert told["result"]["verdict"] == "certified"
    assert told["result"]["clearance"][0]["verdict"] == "refuted"
    examined = examine(told)
    assert not failing(examined)
    assert "clearance.verdict" in examined.unread
    for change in ({"clearance": [0.5, 0.6]}, {"shape": {"diagonal": [1e-9, 1e-9], "beside": [0.0, 0.0]}}):
        forged = copy.deepcopy(told)
        forged["result"]["clearance"][0] |= change
        assert doubted(sealed(forged))


@pytest.mark.parametrize(
    ("corners", "simple"),
    [
        ([(0, 0), (2, 0), (2, 2), (0, 2)], True),
        ([(0, 0), (2, 0), (1, 1), (2, 2), (0, 2)], True),  # not convex
        ([(0, 0), (2, 0), (2, 2), (0, 2)] * 2, False),  # listed twice: even-odd would call its inside outside
        ([(0, 0), (2, 2), (2, 0), (0, 2)], False),  # a bow
        ([(0, 3), (2, -2), (-3, 1), (3, 1), (-2, -2)], False),  # a pentagram
        ([(0, 0), (2, 0), (2, 0), (0, 2)], False),  # an edge without length
        ([(0, 0), (2, 0), (1, 0), (0, 2)], False),  # an edge that turns back
        ([(0, 0), (2, 0), (1, 0)], False),  # nothing but edges that turn back
        ([(0, 0), (2, 0)], False),
    ],
)
def test_only_simple_polygons_have_an_inside(corners, simple):
    exact = [tuple(map(Fraction, corner)) for corner in corners]
    for k in range(len(exact)):
        turned = (*exact[k:], *exact[:k])
        assert is_simple(turned) is simple
        assert is_simple(turned[::-1]) is simple


# -- where W12 is not the same everywhere in the tube, what counts is the end that makes the tube wide

BENT = (
    SMALL.replace('[[1, "-0.3"], ["-0.3", 2]]', '[[1, "0.2*x"], ["0.2*x", 2]]').replace(
        "rate: 0.8", "rate: 0.5"
    )
    + "obstacles: [{states: [x, y], disc: {center: [0.4, 0.4], radius: 0.1}},"
    + " {states: [x, y], disc: {center: [0.4, -0.4], radius: 0.1}}]\n"
)


@pytest.fixture(scope="module")
def bent():
    honest = certified(BENT, conditions="none")
    low, high = honest["result"]["clearance"][0]["shape"]["beside"]
    assert low < -0.07 < 0.07 < high
    assert not failing(examine(honest))
    return honest


@pytest.mark.slow
def test_a_tube_is_as_wide_as_its_metric_allows_anywhere_in_it(bent):
    for k in (0, 1):
        forged = copy.deepcopy(bent)
        own = forged["result"]["clearance"][k]["clearance"]
        own[:] = [end * 1.0001 for end in own]
        assert unconfirmed(forged)


@pytest.mark.slow
@pytest.mark.parametrize(("part", "k"), [(part, k) for part in ("diagonal", "beside") for k in (0, 1)])
def test_every_number_of_a_shape_is_examined(bent, part, k):
    forged = copy.deepcopy(bent)
    for own in forged["result"]["clearance"]:
        own["shape"][part][k] *= 0.99
    assert any(name.startswith("W in the plane") for name, _ in failing(examine(sealed(forged))))


NEXT_TO_THE_TUBE = {
    "a corner": [["1/2", "0"], ["1", "1/2"], ["1", "-1/2"]],
    "an edge": [["1/2", "-2"], ["1/2", "2"], ["2", "0"]],
}


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0, 1, 2])
@pytest.mark.parametrize("what", NEXT_TO_THE_TUBE)
def test_every_edge_of_a_polygon_is_kept_away_from(turn, what):
    """Whichever is the first."""
    corners = NEXT_TO_THE_TUBE[what]
    corners = corners[turn:] + corners[:turn]
    polygon = {"obstacles": [{"states": ["x", "y"], "polygon": corners}]}
    honest = certified(SMALL + yaml.safe_dump(polygon), conditions="none")
    assert honest["result"]["clearance"][0]["verdict"] == "certified"
    assert not failing(examine(honest))
    forged = copy.deepcopy(honest)
    grow(forged["result"])
    assert any(name.startswith("clearance") for name, _ in failing(examine(sealed(forged))))


@pytest.mark.parametrize(
    "beside", [(-1, 1), (Fraction("0.2"), Fraction("0.7")), (Fraction("-0.7"), Fraction("-0.2"))]
)
def test_what_a_direction_is_at_most_is_reached_at_an_end_of_what_stands_beside(beside):
    shape = Shape((Fraction(2), Fraction(3)), tuple(map(Fraction, beside)))
    for c, s in _turned():
        ends = [2 * c * c + 3 * s * s + 2 * c * s * w for w in shape.beside]
        assert _square(shape, (c, s)) == max(ends)
