"""A number that must not exceed another."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """`what` was measured, in `unit`."""

    what: str
    found: float
    limit: float
    unit: str
    more: str = ""

    @property
    def kept(self) -> bool:
        """Whether it does not."""
        return self.found <= self.limit

    def __str__(self) -> str:
        return f"{self.what}: {self.found:.2f} {self.unit} (≤ {self.limit:g}){self.more}"
