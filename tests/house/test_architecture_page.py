"""docs/architecture.md: every room is drawn, with what it may have in lines, and trusted rooms are in brackets."""

import re
from pathlib import Path

import pytest
from test_architecture import PACKAGE
from test_budget import BUDGET, OWN
from test_trust import TRUSTED_ROOMS

PAGE = (Path(__file__).parents[2] / "docs" / "architecture.md").read_text("utf-8")
HOUSE, CORRIDOR = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
SIZES = {name: float(size) for name, size in re.findall(r"\[?(\w+)\]? (\d+\.\d)\b", HOUSE)}


def test_every_room_has_its_size():
    names = {"themselves," if room == OWN else room: lines for room, (lines, *_) in BUDGET.items()}
    together = re.search(r"by (themselves,) (\d+\.\d) together", HOUSE)
    sizes = SIZES | {together[1]: float(together[2])}
    assert names.keys() == sizes.keys()
    for name, lines in names.items():
        assert 1000 * sizes[name] == pytest.approx(lines, rel=0.2, abs=200), name


def test_trusted_rooms_are_in_brackets():
    drawn = re.findall(r"\[(\w+)\]", HOUSE)
    assert set(drawn) <= TRUSTED_ROOMS
    assert not [room for room in SIZES if (room in TRUSTED_ROOMS) != (room in drawn)]


def test_the_corridor_leads_through_rooms():
    for line in CORRIDOR.splitlines():
        for room in re.split(r"\s{2,}", line)[0].split(", "):
            assert (PACKAGE / room).is_dir() or (PACKAGE / f"{room}.py").exists(), room
