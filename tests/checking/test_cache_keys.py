"""What an outcome is kept under: everything that a certification rests on, each with another value another name."""

import copy
from fractions import Fraction

import pytest
from systems import SMALL
from texts import ROOT

from tubecert.checking import cache
from tubecert.spec import Setting, canonical, load
from tubecert.spec.load import load_source
from tubecert.spec.source import Source

SPECIFICATIONS = [
    *sorted((ROOT / "tests" / "specs" / "ok").glob("*.yaml")),
    ROOT / "configs" / "two_state.yaml",
]
NO_MATTER = {"expect"}


def leaves(data, path=()):
    """The places of all values."""
    members = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else None
    if not members:
        return [path]
    return [place for key, value in members for place in leaves(value, (*path, key))]


def changed(data, path):
    """A copy in which one value is another one."""
    copied = copy.deepcopy(data)
    inner = copied
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = f"{inner[path[-1]]} and more"
    return copied


def key(spec):
    return cache.key_of_system(spec, Fraction(1, 100), 10**6)


@pytest.mark.parametrize("path", SPECIFICATIONS, ids=lambda path: path.stem)
def test_every_value_counts(path, monkeypatch):
    spec = load(str(path), reads="question")
    effective = canonical(spec)
    before = key(spec)
    assert "safe_set" in effective
    for place in leaves(effective):
        monkeypatch.setattr(cache, "canonical", lambda _, place=place: changed(effective, place))
        assert (key(spec) == before) is (place[0] in NO_MATTER), place


def test_every_section_counts_by_its_presence(monkeypatch):
    spec = load(str(ROOT / "configs" / "two_state.yaml"))
    effective = canonical(spec)
    before = key(spec)
    for name in effective:
        monkeypatch.setattr(
            cache, "canonical", lambda _, name=name: {k: v for k, v in effective.items() if k != name}
        )
        assert (key(spec) == before) is (name in NO_MATTER), name


@pytest.mark.parametrize("changes", [{"gap": Fraction(1, 50)}, {"budget": 10**5}])
def test_the_effort_counts(changes):
    spec = load(str(ROOT / "configs" / "two_state.yaml"))
    effort = {"gap": Fraction(1, 100), "budget": 10**6}
    assert cache.key_of_system(spec, **effort) != cache.key_of_system(spec, **{**effort, **changes})


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("2*sin(2*t)", "2*sin(3*t)", False),
        ("# x' = f(x) + B (u + h(t, x))", "# another comment", True),
        ("epsilon: 0.6", "epsilon: 3/5", True),
    ],
)
def test_the_text_counts_by_what_it_says(old, new, same, tmp_path):
    text = (ROOT / "configs" / "two_state_orbit.yaml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    target = tmp_path / "changed.yaml"
    target.write_text(text.replace(old, new), encoding="utf-8")
    assert (key(load(str(target))) == key(load(str(ROOT / "configs" / "two_state_orbit.yaml")))) is same


def test_what_was_set_in_place_of_the_file_counts():
    """The text is the same, and what is found is not."""
    source = Source.of("small.yaml", SMALL)
    set_to = [(), ("tube.epsilon=0.5",), ("tube.epsilon=0.4",), ("tube.rho_a=0.4",)]
    specs = [load_source(source, list(map(Setting.of, words))) for words in set_to]
    assert len({spec.source for spec in specs}) == 1
    assert len({cache.key_of_text("lint", spec) for spec in specs}) == len(specs)
    assert len({key(spec) for spec in specs}) == len(specs)
