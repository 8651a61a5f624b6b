"""What anybody who watches may ask for and say: WebSocket and server-sent events."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable

from tests.attack.by_frames import AS_FAST_AS_IT_GOES
from tests.attack.hostile_crowd import Crowd, get, stream, text
from tests.attack.target import Steps, Target, attack


def talking(at: Target, viewers: int, per_s: float, query: str, say: Callable[[int], str]) -> Steps:
    """So many viewers, each of which says something so often; whoever is let go comes back."""
    crowd = Crowd(at, lambda _n: stream(query=query))
    crowd.open(range(viewers))
    crowd.until_heard()
    turns = itertools.count()
    yield

    def speak() -> None:
        n = next(turns)
        crowd.write(n % viewers, text(say(n)))
        if n % 20 == 0:
            crowd.reopen()

    return f"{at.paced(viewers * per_s, speak)}, {crowd.ended:,} let go"


@attack(seconds=2.4)
def subnormal_rates(at: Target) -> Steps:
    """five viewers alternate between 1e-320 to 7e-320 Hz and 0 Hz, eight times a second each"""
    rates = ["0", *(f"{n}e-320" for n in range(1, 8)), "5e-324", "1e-300", "0.0001"]
    return (
        yield from talking(
            at, 5, 8, "hz=30", lambda n: f'{{"type":"rate","hz":{rates[n // 5 % len(rates)]}}}'
        )
    )


@attack()
def chatter(at: Target) -> Steps:
    """500 viewers that send as many messages as allowed: pings, and rates from 0.1 to 60 Hz"""
    draw = random.Random(5)

    def say(n: int) -> str:
        if n % 500 < 200:
            return f'{{"type":"rate","hz":{draw.uniform(0.1, 60):.6f}}}'
        return f'{{"type":"ping","t":{n}}}'

    return (yield from talking(at, 500, 9.5, "hz=1", say))


@attack()
def rates_of_their_own(at: Target) -> Steps:
    """1,000 viewers, each with a rate of its own between 1 and 11 Hz"""
    crowd = Crowd(at, lambda n: stream(query=f"hz={1 + n / 100:.3f}"))
    crowd.open(range(1000))
    crowd.until_heard()
    crowd.bytes_read = 0
    yield
    at.paced(50, crowd.reopen)
    return f"{len(crowd.sockets):,} viewers, {crowd.bytes_read / 1e6:.1f} MB read"


@attack()
def joins_and_leaves(at: Target) -> Steps:
    """viewers that join and leave, 100 at a time, at full speed"""
    crowd = Crowd(at, lambda _n: stream(query="hz=60"))
    yield

    def turn() -> None:
        crowd.open(range(100))
        crowd.until_heard(1.0)
        for number in list(crowd.sockets):
            crowd.drop(number, reset=number % 2 == 0)

    at.paced(AS_FAST_AS_IT_GOES, turn)
    return f"{crowd.opened / at.seconds:,.0f}/s"


@attack()
def asks_and_resets(at: Target) -> Steps:
    """50 clients at a time request JSON at 60 Hz and reset before the answer, at full speed"""
    crowd = Crowd(at, lambda _n: stream(query="hz=60&format=json"))
    yield

    def turn() -> None:
        crowd.open(range(50))
        for number in list(crowd.sockets):
            crowd.drop(number, reset=True)

    at.paced(AS_FAST_AS_IT_GOES, turn)
    return f"{crowd.opened / at.seconds:,.0f}/s"


@attack()
def json_for_nobody(at: Target) -> Steps:
    """1,900 viewers that request JSON at 60 Hz and read nothing"""
    crowd = Crowd(at, lambda _n: stream(query="hz=60&format=json"), small=True)
    yield
    crowd.open(range(1900))
    at.paced(1, lambda: None)
    return f"{crowd.opened:,} streams"


def asked_for_nobody(at: Target) -> Steps:
    """Each asker for another name, a hundred at a time."""
    n = itertools.count()

    def ask(number: int) -> bytes:
        count = next(n)
        return stream("innocent", f"view=v{count}") if number % 2 else stream(f"nobody-{count}")

    crowd = Crowd(at, ask)
    yield

    def turn() -> None:
        crowd.open(range(100))
        crowd.until_heard(1.0)
        for number in list(crowd.sockets):
            crowd.drop(number)

    at.paced(AS_FAST_AS_IT_GOES, turn)
    return f"{crowd.opened / at.seconds:,.0f}/s"


@attack()
def names_of_nobody(at: Target) -> Steps:
    """viewers that request absent views and robots, each another one, at full speed"""
    return (yield from asked_for_nobody(at))


@attack(seconds=2.4)
def nobody_reads(at: Target) -> Steps:
    """500 viewers at 60 Hz that read nothing and acknowledge everything; 300 more on server-sent events"""

    def ask(n: int) -> bytes:
        form = "&format=json" if n % 2 else ""
        if n < 500:
            return stream(query=f"hz=60{form}")
        return get(f"/api/v1/robots/innocent/live.sse?hz=60{form}")

    crowd = Crowd(at, ask, small=True)
    yield
    crowd.open(range(800))
    turns = itertools.cycle(range(500))
    ack = text('{"type":"ack","n":9007199254740991}')
    at.paced(2500, lambda: crowd.write(next(turns), ack))
    return f"{crowd.opened} streams"


@attack()
def broken_rules(at: Target) -> Steps:
    """100 viewers: false acknowledgements, 1e999 Hz, surrogates, endless pings and fragments, bad frames"""
    counts = (2**53 - 1, 0, -1, "1e300", "1e999", 0.5, "9" * 3000, "true")
    said = [f'{{"type":"ack","n":{n}}}' for n in counts]
    said += [f'{{"type":"rate","hz":{n}}}' for n in ("1e999", "-1", "NaN", "9" * 3000, "1e-400", "null")]
    said += ["[" * 4000, '{"type":' * 400, "\ufeff{}", '{"type":"auth","token":"\\ud800"}', "", "null"]
    said += ['{"type":"ping","t":1e999}', '{"type":"ping","t":9007199254740993}', "x" * 5000]
    piece, ping = b"\x00\x80\0\0\0\0", b"\x89\x80\0\0\0\0"
    floods = [b"\x01\x80\0\0\0\0" + piece * 5000, ping * 5000, b"\xf3\xff" + b"\xff" * 20]
    floods += [b"\x82\x80\0\0\0\0", b"\x81\xff\x7f" + b"\xff" * 7, b"\x88\x81\0\0\0\0x"]
    floods += [text(one) for one in said]
    crowd = Crowd(at, lambda _n: stream(query="hz=10"))
    crowd.open(range(100))
    crowd.until_heard()
    turns = itertools.count()
    yield

    def flood() -> None:
        n = next(turns)
        crowd.write(n % 100, floods[n % len(floods)])
        crowd.reopen()

    return f"{at.paced(1000, flood)}, {crowd.ended:,} let go"
