"""What a robot may send as frames."""

from __future__ import annotations

import itertools
import math
import random
import struct

from posecast_wire import Encoder, Stamp, frame_id

from tests.attack.hostile_crowd import Crowd, stream, text
from tests.attack.hostile_robot import Robot, key_frame, open_session, plain_frame, schema_of
from tests.attack.target import Steps, Target, attack

AS_FAST_AS_IT_GOES = 1e9
ONE_BASE_FRAMES = 60_000  # a distance is a u16


class Ready:
    """Valid plain frames of one robot, made in advance: encoding must not limit the attack."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._key = robot.frame(key=True)
        self._base_id = frame_id(self._key)
        self._body = robot.frame()[9:]
        self._distance = 0

    def begin(self) -> None:
        """The KEY all are coded against."""
        self._robot.put(self._key)

    def put(self) -> None:
        """The next one."""
        self._distance = self._distance % ONE_BASE_FRAMES + 1
        self._robot.put(plain_frame(self._base_id, self._distance, self._body))


@attack()
def keys_of_60_kb(at: Target) -> Steps:
    """KEYs of 60 kB, 500 a second"""
    robot = Robot(at).on_air()
    yield
    seq = itertools.count(robot.seq + 1)
    return at.paced(500, lambda: robot.put(key_frame(robot.schema.id, next(seq), 60_000)))


@attack()
def plain_frames_3000(at: Target) -> Steps:
    """plain frames of one robot with 20 viewers, 3,000 a second"""
    robot = Robot(at).on_air()
    ready = Ready(robot)
    ready.begin()
    crowd = Crowd(at, lambda _n: stream("rude", "hz=60"))
    crowd.open(range(20))
    crowd.until_heard()
    yield

    def put() -> None:
        ready.put()
        crowd.reopen()

    return at.paced(3000, put)


@attack(guarded=True)
def plain_frames_unpaced(at: Target) -> Steps:
    """plain frames at full speed, from an enrolled robot to a relay that requires credentials"""
    robot = Robot(at).on_air()
    ready = Ready(robot)
    ready.begin()
    yield
    return at.paced(AS_FAST_AS_IT_GOES, ready.put)


@attack()
def keys_of_2_kb(at: Target) -> Steps:
    """KEYs of 2 kB, which the relay hashes, 10,000 a second"""
    robot = Robot(at).on_air()
    yield
    seq = itertools.count(robot.seq + 1)
    return at.paced(10_000, lambda: robot.put(key_frame(robot.schema.id, next(seq), 2_000)))


@attack()
def sixteen_views(at: Target) -> Steps:
    """one robot with 16 views, each at 300 frames a second"""
    session = open_session(at)
    robots = [Robot(at, view=f"v{n}", session=session) for n in range(16)]
    ready = [Ready(robot) for robot in robots]
    for of in ready:
        of.begin()
    yield
    turns = itertools.cycle(ready)
    return at.paced(4800, lambda: next(turns).put())


@attack()
def names_900(at: Target) -> Steps:
    """900 robots in one session, 5,000 frames a second in total"""
    session = open_session(at)
    robots = [Robot(at, f"rude-{n}", session=session) for n in range(900)]
    yield
    turns = itertools.cycle(robots)

    def put() -> None:
        robot = next(turns)
        robot.seq += 1
        robot.put(key_frame(robot.schema.id, robot.seq, 100))

    return at.paced(5000, put)


@attack()
def frames_of_100_mb(at: Target) -> Steps:
    """frames of 100 MB at full speed"""
    robot = Robot(at).on_air()
    huge = bytes(100_000_000)
    yield
    return at.paced(5, lambda: robot.put(huge))


@attack()
def attachments_of_1_mb(at: Target) -> Steps:
    """valid frames with an attachment of 1 MB, 200 a second"""
    robot = Robot(at).on_air()
    huge = bytes(1_000_000)
    yield
    return at.paced(200, lambda: robot.put(robot.frame(), huge))


@attack()
def frames_that_are_none(at: Target) -> Steps:
    """empty, truncated and random frames, of other versions and under invalid names: 2,000 a second"""
    robot = Robot(at).on_air()
    draw = random.Random(1)
    sound = robot.frame(key=True)
    session, ends = robot.session, ("frame", "event")
    names = ["UPPER", "-", "é", "a" * 64, "a" * 60_000, "\u202egnol", "x y", "%2e%2e", "rude"]
    views = ["public", "P", "é" * 100, "-", "v" * 64]
    broken = [
        b"",
        b"\x13",
        b"\xff" * 20,
        sound[:12],
        sound[:-1],
        sound + b"\0" * 9,
        bytes(65_537),
        b"\x10" * 9,
    ]
    stamps = [b"", bytes(16), b"\xff" * 16, b"x" * 15, robot.stamp()]
    yield

    def put() -> None:
        key = f"posecast/v1/{draw.choice(names)}/{draw.choice(views)}/{draw.choice(ends)}"
        payload = draw.choice(broken) if draw.random() < 0.7 else draw.randbytes(draw.randrange(200))
        session.put(key, payload, attachment=draw.choice(stamps))

    return at.paced(2000, put)


@attack()
def impossible_numbers(at: Target) -> Steps:
    """new runs, stamps of 2⁶⁴ − 1, wrapping seq, times of ±1e308: 1,000 frames a second"""
    robot = Robot(at).on_air()
    draw = random.Random(2)
    elapsed = (0, 1, 2**63, 2**64 - 1)
    times_s = (1.0, -1.0, 1e308, -1e308, 5e-324, math.inf, math.nan)
    schema_id = robot.schema.id
    yield

    def put() -> None:
        run = robot.run_id if draw.random() < 0.7 else draw.randrange(1, 2**64)
        stamp = Stamp(run, draw.choice((*elapsed, draw.getrandbits(64)))).pack()
        seq = draw.choice((0, 1, 2**32 - 1, draw.getrandbits(32)))
        frame = key_frame(schema_id, seq, 80, draw.choice(times_s))
        robot.put(frame, stamp)
        robot.put(plain_frame(frame_id(frame), draw.choice((0, 1, 65_535)), bytes(40)), stamp)

    return at.paced(500, put)


@attack()
def a_schema_with_every_key(at: Target) -> Steps:
    """KEYs of two alternating schemas of 4,096 channels, 200 a second; every query is answered"""
    robot = Robot(at).on_air()
    schemas = [schema_of(4096, name) for name in ("left.", "right.")]
    keys = [Encoder(schema).encode([9] * 4096, 1, 1.0, 1.0) for schema in schemas]
    turns = itertools.count()
    at_now = [0]
    robot.answers = lambda: [robot.snapshot(schemas[at_now[0]].text)]
    yield

    def put() -> None:
        n = next(turns)
        at_now[0] = n // 2 % 2
        key = keys[at_now[0]]
        robot.put(struct.pack("<BIId", 0x13, schemas[at_now[0]].id, 1000 + n, 1.0 + n) + key[17:])

    return at.paced(200, put)


@attack()
def widest_frames_for_500(at: Target) -> Steps:
    """frames of 16 kB, 60 a second, to 500 viewers that read and acknowledge everything"""
    robot = Robot(at, schema=schema_of(4096)).on_air()
    key = robot.frame(key=True)
    robot.put(key)
    distance, turns = itertools.count(1), itertools.cycle(range(500))
    body = bytes(16_000)
    crowd = Crowd(at, lambda _n: stream("rude", "hz=60"))
    crowd.open(range(500))
    crowd.until_heard()
    crowd.bytes_read = 0
    ack = text('{"type":"ack","n":9007199254740991}')
    yield

    def put() -> None:
        robot.put(plain_frame(frame_id(key), next(distance) % ONE_BASE_FRAMES, body))
        for _ in range(10):
            crowd.write(next(turns), ack)
        crowd.reopen()

    return f"{at.paced(60, put)}, {crowd.bytes_read / 1e6:,.0f} MB read"


@attack()
def widest_robot_for_json(at: Target) -> Steps:
    """a robot of 4,096 channels at 60 frames a second, with five JSON viewers"""
    robot = Robot(at, schema=schema_of(4096)).on_air()
    ready = Ready(robot)
    ready.begin()
    crowd = Crowd(at, lambda _n: stream("rude", "format=json&hz=60"))
    crowd.open(range(5))
    crowd.until_heard()
    yield

    def put() -> None:
        ready.put()
        crowd.reopen()

    return at.paced(60, put)
