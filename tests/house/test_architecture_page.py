"""docs/architecture.md: every room is drawn once and has its size, and what is drawn as trusted is trusted."""

import re
from pathlib import Path

import pytest
from test_budget import BUDGET, OWN
from test_trust import TRUSTED_ROOMS

PAGE = (Path(__file__).parents[2] / "docs" / "architecture.md").read_text("utf-8")
DRAWING = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)[0]
SIZES = {name: float(size) for name, size in re.findall(r"(`\w+`|single modules) (\d+\.\d)", PAGE)}


def test_every_room_is_drawn_and_trusted_ones_are_in_brackets():
    for room in BUDGET.keys() - {OWN}:
        assert re.search(rf"\b{room}\b", DRAWING), room
        assert (f"[{room}]" in DRAWING) == (room in TRUSTED_ROOMS), room


def test_sizes_are_those_of_the_budget():
    names = {"single modules" if room == OWN else f"`{room}`": room for room in BUDGET}
    assert names.keys() == SIZES.keys()
    for name, room in names.items():
        assert 1000 * SIZES[name] == pytest.approx(BUDGET[room][0], rel=0.1, abs=100), room
