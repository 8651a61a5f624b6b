"""Lines that no robot's program should write, to the real agent: it names them in few words and goes on."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress

import pytest
from edge_stage import Edge, Router
from posecast_testing import until
from posecast_wire.frame import FrameError
from test_model_background import RSS_KB_MAX, memory_kb

LINES = {
    "half a character in a text": r'{"pos":{"A":1.5},"info":{"mode":"\ud800"}}',
    "in a text's name": r'{"pos":{"A":1.5},"info":{"\ud800":"x"}}',
    "in a field's name": r'{"pos":{"A":1.5},"\ud800":{"A":1.0}}',
    "in a channel's name": r'{"pos":{"A":1.5,"\ud800":1.0}}',
    "in a bit's name": r'{"pos":{"A":1.5},"flags":{"A":["\ud800"]}}',
    "numbers past every float": '{"pos":{"A":1.5,"B":%s}}' % ("9" * 5000),
    "1e999": '{"pos":{"A":1.5,"B":1e999}}',
    "a boolean": '{"pos":{"A":1.5,"B":true}}',
    "a text for a number": '{"pos":{"A":1.5,"B":"\\u202e"}}',
    "a list for a number": '{"pos":{"A":1.5,"B":%s}}' % ("[" * 300 + "]" * 300),
    "a number for a field": '{"pos":{"A":1.5},"ref":5}',
    "a name twice": '{"pos":{"A":0.5},"pos":{"A":1.5}}',
    "a byte order mark": '\ufeff{"pos":{"A":1.5}}',
}
SILENT = ("1e999", "numbers past every float", "a name twice", "a byte order mark")
REFUSED = {
    "deep": "[" * 100_000,
    "no JSON": "oops",
    "no object": "[1]",
    "no time": '{"t":1e999,"pos":{"A":1.5}}',
    "a long line": '{"pos":{"A":' + "1" * 2_000_000 + "}}",
    "zeros": "\0" * 100,
}


def read(router: Router) -> float | None:
    """Where joint A is, as the newest frame has it; None before there is one."""
    decoder = router.decoder()
    if decoder is None:
        return None
    value = None
    for frame in list(router.frames):
        with suppress(FrameError):  # of a schema before
            value = decoder.decode(frame.data).values("pos")[0]
    return value


def check_line(router: Router, e: Edge, kind: str) -> None:
    before = read(router)

    def shown() -> bool:
        e.send_text(LINES.get(kind) or REFUSED[kind])
        if kind in REFUSED:
            e.send(pos={"A": 1.5, "B": 0.5})
        value = read(router)
        return value is not None and value != before and abs(value - 1.5) < 0.01

    until(f"{kind}: the rest of the line, or the next one", shown)
    assert e.process.poll() is None
    assert memory_kb(e.process.pid) < RSS_KB_MAX


def check_words(e: Edge) -> None:
    assert all(len(line) < 700 and line.isprintable() for line in e.lines if "stdin line" in line)
    assert not any("Traceback" in line for line in e.lines)


# each kind decides alone what the robot has; in `make test` some do, and parse_line reads all kinds in
# test_later_lines, test_parsers.py and fuzz/
FIRST = ("in a channel's name", "a boolean", "deep")
OTHERS = [pytest.param(kind, marks=pytest.mark.full) for kind in (*LINES, *REFUSED) if kind not in FIRST]


@pytest.mark.parametrize("kind", [*FIRST, *OTHERS])
def test_a_first_line(router: Router, edge: Callable[..., Edge], kind: str) -> None:
    e = edge("--key-interval", "1")
    check_line(router, e, kind)
    if kind not in SILENT:
        until("a word about it", lambda: any("stdin line" in line for line in e.lines))
    check_words(e)


def test_later_lines(router: Router, edge: Callable[..., Edge]) -> None:
    e = edge("--key-interval", "1")
    good = {"pos": {"A": 0.5, "B": 0.5}, "flags": {"A": ["jam"]}}
    for kind in (*LINES, *REFUSED):
        e.send(**good)
        until("a good one", lambda: abs((read(router) or 0.0) - 0.5) < 0.01)
        check_line(router, e, kind)
    until("a word about some", lambda: sum("stdin line" in line for line in e.lines) > 5)
    check_words(e)


def test_ten_thousand_bad_lines_are_a_few_lines(router: Router, edge: Callable[..., Edge]) -> None:
    e = edge()
    bad = [*LINES.values(), *(line for kind, line in REFUSED.items() if len(line) < 1000)]
    for i in range(10_000):
        e.send_text(bad[i % len(bad)])
    e.send_text(json.dumps({"pos": {"A": 2.5}}))
    until("the last", lambda: (read(router) or 0) > 2.4, 30.0)
    e.end_of_input()
    assert e.wait(20) == 0
    assert len(e.lines) < 60, e.lines
