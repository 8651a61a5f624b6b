"""What can be done at the door that robots come through, below frames and events."""

from __future__ import annotations

import itertools
import random
import socket
import threading
from contextlib import suppress

import zenoh
from posecast_wire import alive_key, echo_key, event_key, frame_key

from tests.attack.by_frames import AS_FAST_AS_IT_GOES
from tests.attack.hostile_crowd import allow_sockets
from tests.attack.hostile_robot import Robot, open_session
from tests.attack.target import Steps, Target, attack


@attack()
def echoes(at: Target) -> Steps:
    """echo queries, for one robot and for all, at full speed"""
    robot = Robot(at).on_air()
    keys = itertools.cycle([echo_key("rude"), echo_key("innocent"), echo_key("nobody"), "posecast/v1/*/echo"])
    yield
    return at.paced(
        AS_FAST_AS_IT_GOES, lambda: robot.session.get(next(keys), lambda _reply: None, timeout=1.0)
    )


@attack()
def tokens(at: Target) -> Steps:
    """1,000 liveliness tokens a second: one robot comes and goes, 1,800 others stay"""
    session = open_session(at)
    kept: list[object] = []
    n = itertools.count()
    yield

    def declare() -> None:
        name = f"{'x' if next(n) % 2 else 'É'}{next(n)}"
        kept.append(session.liveliness().declare_token(f"posecast/v1/{name}/alive"))
        session.liveliness().declare_token(alive_key("rude")).undeclare()  # type: ignore[no-untyped-call]

    return at.paced(1000, declare)


@attack()
def tokens_that_stay(at: Target) -> Steps:
    """900 liveliness tokens at once, each for a robot that never sends"""
    session = open_session(at)
    yield
    kept = [session.liveliness().declare_token(alive_key(f"silent-{n}")) for n in range(900)]
    at.paced(1, lambda: None)
    return f"{len(kept):,} robots"


@attack()
def declarations(at: Target) -> Steps:
    """subscriptions to everything and to 2,000 more keys a second; false answers for the innocent robot"""
    session = open_session(at)
    kept: list[object] = []
    n, answered = itertools.count(), itertools.count()

    def reply(query: zenoh.Query) -> None:
        next(answered)
        with suppress(zenoh.ZError):
            query.reply(query.key_expr, b"\xff" * 1000, attachment=b"x" * 16)

    yield
    kept.append(session.declare_subscriber("**", lambda _sample: None))
    kept.append(session.declare_queryable("posecast/v1/innocent/*/snapshot", reply))

    def declare() -> None:
        kept.append(session.declare_subscriber(f"posecast/v1/{next(n)}/**", lambda _sample: None))

    return at.paced(2000, declare) + f", {next(answered)} false answers"


@attack()
def links(at: Target) -> Steps:
    """connections to both ports: silent, with meaningless bytes, or valid and closed at once"""
    allow_sockets()
    kept: list[socket.socket] = []
    draw, turns = random.Random(4), itertools.count()
    yield

    def connect() -> None:
        n = next(turns)
        if n % 100 == 0:
            with suppress(zenoh.ZError):
                open_session(at, wait_ms=50).close()  # type: ignore[no-untyped-call]
        with suppress(OSError):
            made = socket.create_connection(at.zenoh_address if n % 2 else at.address, 1.0)
            if n % 3:
                made.sendall(draw.randbytes(draw.randrange(1, 2000)))
            if n % 4:
                kept.append(made)

    return at.paced(1000, connect) + f", {len(kept):,} left open"


@attack(guarded=True)
def foreign_keys(at: Target) -> Steps:
    """an enrolled robot publishes as another, 5,000 times a second; strangers try passwords"""
    robot = Robot(at).on_air()
    session, frame = robot.session, robot.frame(key=True)
    of_another = [frame_key("innocent", "public"), event_key("innocent", "public"), alive_key("innocent")]
    keys = itertools.cycle(of_another)
    tried = itertools.count()

    def knock() -> None:
        while not at.over():
            next(tried)
            with suppress(zenoh.ZError):
                open_session(at, "innocent", "wrong" * 8, wait_ms=100).close()  # type: ignore[no-untyped-call]

    yield
    threading.Thread(target=knock, daemon=True).start()
    did = at.paced(5000, lambda: session.put(next(keys), frame, attachment=robot.stamp()))
    return f"{did}, {next(tried)} passwords"
