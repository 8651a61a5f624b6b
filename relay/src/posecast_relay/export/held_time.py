"""What of a span of the past is there: its first and its last moment, and the gaps between them."""

from __future__ import annotations

from dataclasses import dataclass

GAP_MS = 2000  # a robot that stands still sends two frames a second: a longer pause is a lack


@dataclass
class HeldTime:
    """What was added so far, unix ms. `from_ms`, `to_ms`: the first moment and the last, 0 without any;
    `gaps`: how many, `gaps_ms`: how long all together, `gap_from_ms`: where the first one begins."""

    from_ms: int = 0
    to_ms: int = 0
    gaps: int = 0
    gaps_ms: int = 0
    gap_from_ms: int = 0

    def add(self, from_ms: int, to_ms: int) -> None:
        """Add a stretch of it, which begins no earlier than the one before, or a moment."""
        if not self.to_ms:
            self.from_ms = from_ms
        elif from_ms - self.to_ms > GAP_MS:
            self.gap_from_ms = self.gap_from_ms or self.to_ms
            self.gaps += 1
            self.gaps_ms += from_ms - self.to_ms
        self.to_ms = max(self.to_ms, to_ms)
