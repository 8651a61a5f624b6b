"""Time and memory of every parser grow no faster than its input, of the worst kind that is known."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from cost_stage import SLACK, SPAN, assert_time_in_proportion
from every_parser import PARSERS
from parser_stage import Parser, Work, held_bytes, in_one_line

KINDS = [(name, kind) for name, parser in PARSERS.items() for kind in parser.worst]
BYTES = 1 << 20  # whatever the input


def prepared(parser: Parser, kind: str, n: int, folder: Path) -> Work:
    """One run; what it may refuse it may."""
    folder.mkdir()
    work = parser.work(parser.worst[kind].input(n), folder)

    def run() -> None:
        with in_one_line(*parser.refuses):
            work()

    return run


def lower_bounds(parser: Parser, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for place, value in parser.worst[kind].bounds.items():
        module, _, name = place.rpartition(".")
        monkeypatch.setattr(importlib.import_module(module), name, value, raising=False)


@pytest.mark.parametrize(("name", "kind"), KINDS)
def test_time(name: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parser = PARSERS[name]
    lower_bounds(parser, kind, monkeypatch)
    assert_time_in_proportion(lambda n: prepared(parser, kind, n, tmp_path / str(n)), parser.worst[kind].n)


# what takes memory with the square takes such time too: test_time. Tracing costs ten times as much
@pytest.mark.full
@pytest.mark.parametrize(("name", "kind"), KINDS)
def test_memory(name: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parser = PARSERS[name]
    lower_bounds(parser, kind, monkeypatch)
    n = parser.worst[kind].n
    small, large = (held_bytes(prepared(parser, kind, n * k, tmp_path / str(k))) for k in (1, SPAN))
    assert large < SPAN * SLACK * small + BYTES
