"""Where something stands on the command line."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.findings import Location


@dataclass(frozen=True, slots=True, kw_only=True)
class OptionPlace(Location):
    """A place in the value of an option: the option's name stands for file, line and column."""

    def __str__(self) -> str:
        return self.file
