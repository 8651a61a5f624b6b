"""Numbers of things in lines for people."""

from __future__ import annotations


def write_count(number: int, noun: str) -> str:
    """Write a number and a noun, which takes an s unless it is one: 1 segment, 1,204 segments."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
