"""Formats counts of things for people."""

from __future__ import annotations


def write_count(number: int, noun: str) -> str:
    """Format a number and a noun, with a plural s unless the number is 1: 1 segment, 1,204 segments."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
