"""Makes `wire/vectors/`: deterministic, so that a test can compare what is committed with what this makes.

Every file of frames holds `schemas` by name and `cases`; a case is a script that any decoder can follow from
a fresh start, step by step: learn a schema, or decode a frame and get `state` (with seq, t and codes),
`unknown` or `bad` (with `says`: in these words). A case with `encode` also tells an encoder what to make the
same bytes from.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from posecast_wire import CODE_MAX, MISSING, frame_id

from wire.python.tools.hand_made import key_frame, packed, plain_frame, reserved_frame
from wire.python.tools.vector_script import CHAIN, ONE, SCHEMAS, Case, Dice, Script, Stream


def moving(dice: Dice) -> list[Case]:
    """What a robot usually sends."""
    cases: list[Case] = []

    s = Stream("key", "a KEY alone", "arm")
    s.send([100, -200, 300, -400, 101, -200, 299, -402, 7, -8, 900, 1040, 31, 32, 33, 34, 3, 3, 7, 0], 1, 0.5)
    cases.append(s.done())

    s = Stream("still", "nothing moves: a nibble a field", "arm")
    for i in range(3):
        s.send([5] * s.size, i, i / 30)
    cases.append(s.done())

    s = Stream("walk", "plain frames; KEYs every 0.5 s teach the order table", "arm", 0.5)
    codes = [0] * s.size
    for i in range(40):
        codes = dice.moved(codes, 6)
        s.send(codes, i, i / 30)
    cases.append(s.done())

    s = Stream("slow", "slow fields move like all others", "arm")
    codes = [0] * s.size
    for i in range(16):
        codes = dice.moved(codes, 9)
        s.send(codes, 1000 + i, 50 + i / 10)
    cases.append(s.done())

    s = Stream("wide", "300 channels", "wide", 0.3)
    codes = [dice.near(2000) for _ in range(s.size)]
    for i in range(12):
        codes = dice.moved(codes, 2 if i < 6 else 40)
        s.send(codes, i, i / 30)
    return [*cases, s.done()]


def extremes(dice: Dice) -> list[Case]:
    """Readings missing, jumping, and at the ends of the range."""
    cases: list[Case] = []

    s = Stream("missing", "readings come and go, also under rel", "arm")
    for i in range(12):
        codes = [MISSING if dice.below(4) == 0 else dice.near(50) for _ in range(s.size)]
        s.send(codes, i, i / 30)
    cases.append(s.done())

    s = Stream("jumps", "jumps of 2^20 either way, in one channel or many", "arm")
    for i in range(10):
        codes = [dice.near(1) * (1 << 20) + dice.near(3) for _ in range(s.size)]
        s.send(codes, i, i / 30)
    cases.append(s.done())

    ends = (MISSING, -CODE_MAX, -1, 0, 1, CODE_MAX)
    s = Stream("ends", "the ends of the range against one another, down a chain of rel", "chain")
    for i in range(24):
        s.send([ends[dice.below(6)] for _ in range(s.size)], i, i / 30)
    cases.append(s.done())

    s = Stream("one", "one channel: every power of two", "one")
    for i in range(29):
        s.send([min(1 << i, CODE_MAX) * (1 if i % 2 else -1)], i, i / 30)
    cases.append(s.done())

    return cases


def of_themselves() -> list[Case]:
    """KEYs that nobody asked for, and numbers that wrap."""
    cases: list[Case] = []

    s = Stream("keys", "when a KEY comes of itself", "one", 4.0)
    s.send([1], 7, 10.0, 100.0)
    s.send([2], 8, 10.1, 103.9)
    s.send([3], 9, 10.2, 104.0)  # the edge's clock
    s.send([4], 10, 10.2, 104.1)  # robot time stands: no reason
    s.send([5], 11, 10.1, 104.2)  # robot time steps back
    s.send([6], 12, 75.6, 104.3)  # 65.5 s on: the last that fits
    s.send([7], 13, 75.7, 104.4)  # 65.6 s on: past the header
    s.send([8], 13 + 65535, 75.8, 104.5)
    s.send([9], 13 + 65536, 75.9, 104.6)  # past the header
    s.send([10], 13 + 65537, 76.0, 104.7, True)  # the link came up
    s.send([11], 13 + 65537, 76.0, 104.8)  # the same seq again
    s.send([12], 13 + 65538, 76.0, 104.7)  # a clock that should be monotonic and is not
    cases.append(s.done())

    s = Stream("wrap", "seq passes 2^32", "one")
    for i in range(4):
        s.send([i], (0xFFFFFFFE + i) & 0xFFFFFFFF, i / 30)
    cases.append(s.done())

    return cases


def other_senders() -> list[Case]:
    """Frames no encoder of ours would write, and every decoder must read."""
    other = Script("another sender", "orders all 4, a wasteful n, a zero field spelt out", "one")
    key = key_frame(ONE, 1, 2.5, [(9, [4])], [4])
    other.frame(key)
    for n, code in ((0, 4), (14, 4), (5, 1000), (0, CODE_MAX), (14, MISSING), (15, 4)):
        other.frame(plain_frame(frame_id(key), 2, 40, [(n, [code - 4])], [4]), f"n = {n}")

    longest = Script(
        "longest", "codes of up to 61 bits: no step is larger, and no order makes it longer", "chain"
    )
    ends = [CODE_MAX, CODE_MAX, MISSING, MISSING, CODE_MAX, CODE_MAX]
    key = key_frame(CHAIN, 1, 2.5, longest_body([0] * 6, ends), [4] * 6)
    longest.frame(key)
    swapped = [MISSING, MISSING, CODE_MAX, CODE_MAX, MISSING, MISSING]
    longest.frame(plain_frame(frame_id(key), 1, 33, longest_body(ends, swapped), [4] * 6))
    return [other.done(), longest.done()]


def longest_body(base: Sequence[int], codes: Sequence[int]) -> list[tuple[int, list[int]]]:
    """Fields of two channels, each relative to the one before, every code of order 0."""
    moved = [c - b for c, b in zip(codes, base, strict=True)]
    partners = [0, 0, *moved]
    return [(0, [moved[i] - partners[i], moved[i + 1] - partners[i + 1]]) for i in range(0, len(moved), 2)]


def valid() -> list[Case]:
    dice = Dice(1)
    return moving(dice) + extremes(dice) + of_themselves() + other_senders()


def bad_headers(good: bytes) -> Case:
    """`good`: a KEY of the schema `one`."""
    s = Script("headers", "what is no frame at all", "one")
    s.frame(b"", "empty")
    for tag in (0x00, 0x03, 0x11, 0x14, 0x17, 0x1B, 0x20, 0x23, 0xFF):
        s.frame(bytes([tag]) + good[1:], f"byte 0 is {tag:02x}")
    s.frame(good[:17], "a KEY without a body")
    s.frame(good[:9] + bytes.fromhex("000000000000f07f") + good[17:], "t is infinite")
    s.frame(good[:9] + bytes.fromhex("000000000000f87f") + good[17:], "t is not a number")
    s.frame(good, "and the same decoder takes a good one")
    at = frame_id(good)
    s.frame(plain_frame(at, 1, 0, [(4, [1])], [4])[:9], "no body")
    s.frame(plain_frame(at, 0, 0, [(4, [1])], [4]), "no distance from its base")
    s.frame(plain_frame(at ^ 1, 1, 0, [(4, [1])], [4]), "another base")
    s.frame(good[:1] + b"\1\2\3\4" + good[5:], "another schema")
    s.frame(plain_frame(at, 1, 0, [(4, [1])], [4]), "still the same base")
    return s.done()


def bad_bodies(good: bytes) -> Case:
    """`good`: a KEY of the schema `one`."""
    at = frame_id(good)
    s = Script("bodies", "cut short, padded, past the range", "one")
    s.frame(good)
    plain = plain_frame(at, 1, 0, [(4, [300])], [4])
    s.frame(plain, "good")
    for end in range(9, len(plain)):
        s.frame(plain[:end], f"cut to {end} bytes")
    s.frame(plain + b"\0", "a zero byte too many")
    s.frame(plain + b"\1", "a byte too many")
    s.frame(plain[:-1] + bytes([plain[-1] | 1]), "padding that is not zero")
    s.frame(plain[:9] + b"\0" * 9, "zeros for ever")
    s.frame(plain_frame(at, 1, 0, [(4, [CODE_MAX - 4])], [4]), "the largest code")
    s.frame(plain_frame(at, 1, 0, [(4, [CODE_MAX - 3])], [4]), "one more")
    s.frame(plain_frame(at, 1, 0, [(4, [MISSING - 4])], [4]), "the smallest")
    s.frame(plain_frame(at, 1, 0, [(4, [MISSING - 5])], [4]), "one less")
    s.frame(packed(plain[:9], "0000" + "0" * 32 + "1" * 33), "a residual of 33 bits")
    s.frame(packed(plain[:9], "1110" + "0" * 18 + "1" * 33), "a residual of 33 bits, order 14")
    s.frame(packed(plain[:9], "0100" + "0" * 28 + "1" * 33), "a residual of 33 bits, order 4")
    s.frame(plain[:9] + b"\0" * 9, "as long as its schema can fill")
    s.frame(plain[:9] + b"\0" * 10, "longer")
    s.frame(good[:17] + b"\0" * 9, "a KEY as long as its schema can fill")
    s.frame(good[:17] + b"\0" * 10, "longer")
    s.frame(bytes([0x10]) + plain[1:9] + b"\0" * 65528, "65,537 bytes")
    s.frame(plain, "good still")
    return s.done()


def reserved(good: bytes) -> Case:
    """`good`: a KEY of the schema `one`."""
    s = Script("a REF", "byte 0 is reserved: refused by its name, and no base", "one")
    s.frame(good)
    plain = plain_frame(frame_id(good), 1, 33, [(4, [1])], [4])
    ref = reserved_frame(plain)
    s.frame(ref, "coded against the KEY", says_why=True)
    s.frame(ref[:1] + frame_id(ref).to_bytes(4, "little") + ref[5:], "coded against a REF", says_why=True)
    s.frame(ref[:1], "byte 0 alone", says_why=True)
    s.frame(plain_frame(frame_id(ref), 1, 33, [(4, [1])], [4]), "a plain frame that names it")
    s.frame(plain, "and one that names the KEY")
    return s.done()


def damaged(dice: Dice) -> Case:
    """A stream in a bad neighbourhood."""
    stream = Stream("", "", "arm", 0.4)
    codes = [0] * stream.size
    for i in range(24):
        codes = dice.moved(codes, 5)
        stream.send(codes, i, i / 30)
    s = Script("damage", "bits flipped, ends cut, bytes drawn at random, good frames between", "arm")
    for data in stream.frames:
        for _ in range(4):
            s.frame(_with_damage(dice, data))
        s.frame(data)
    return s.done()


def invalid() -> list[Case]:
    good = key_frame(ONE, 1, 2.5, [(9, [4])], [4])
    return [bad_headers(good), bad_bodies(good), reserved(good), damaged(Dice(2))]


def lossy() -> list[Case]:
    dice = Dice(3)
    cases: list[Case] = []
    stream = Stream("", "", "arm", 0.5)
    codes = [0] * stream.size
    for i in range(48):
        codes = dice.moved(codes, 4)
        stream.send(codes, i, i / 30)
    frames = stream.frames
    keys = [i for i, f in enumerate(frames) if f[0] == 0x13]
    viewers = {
        "one in three, bases always": [i for i in range(48) if i % 3 == 0 or i in keys],
        "bases only": keys,
        "half, bases too": [i for i in range(48) if dice.below(2)],
        "joins late without a snapshot": list(range(20, 48)),
        "loses the second KEY": [i for i in range(48) if i != keys[1]],
    }
    for viewer, delivered in viewers.items():
        s = Script(f"keys only: {viewer}", f"delivered: {delivered}", "arm")
        for i in delivered:
            s.frame(frames[i])
        s.frame(frames[0], "the first KEY once more")
        cases.append(s.done())
    s = Script("keys only: everything twice", "a repeated frame is the same state", "arm")
    for data in frames[:10]:
        s.frame(data)
        s.frame(data)
    return [*cases, s.done()]


def alternating() -> list[Case]:
    dice = Dice(4)
    streams = {name: Stream("", "", name) for name in ("arm", "one")}
    for stream in streams.values():
        for i in range(9):
            codes = dice.moved([10 * i] * stream.size, 5)
            stream.send(codes, i, i / 30, force_key=i % 3 == 0)
    s = Script("two schemas in turn", "a KEY of either retires the other's; both schemas stay known", "arm")
    arm, one = streams["arm"].frames, streams["one"].frames
    s.frame(arm[0])
    s.frame(one[0], "its schema is not here yet")
    s.frame(arm[1], "so nothing changed")
    s.learn("one")
    s.frame(arm[2], "a schema alone retires nothing")
    s.frame(one[0])
    s.frame(arm[1], "its base is retired")
    s.frame(one[1])
    s.frame(arm[3])
    s.frame(arm[4])
    s.frame(one[2], "its base is retired")
    s.frame(one[3])
    s.learn("arm")
    s.frame(one[4])
    s.frame(arm[6])
    s.frame(arm[8])
    return [s.done()]


def _with_damage(dice: Dice, data: bytes) -> bytes:
    kind = dice.below(4)
    if kind == 0:
        return data[: dice.below(len(data))]
    if kind == 1:
        return data[:9] + bytes(dice.below(256) for _ in range(dice.below(40)))
    if kind == 2:
        return bytes(dice.below(256) for _ in range(dice.below(60)))
    body = bytearray(data)
    at = dice.below(len(body))
    body[at] ^= 1 << dice.below(8)
    return bytes(body)


def _written(doc: object, depth: int) -> str:
    """JSON, one step a line: small, and a change shows where it is."""
    if depth and isinstance(doc, dict) and doc:
        inside = [f"{json.dumps(k)}: {_written(v, depth - 1)}" for k, v in doc.items()]
        return "{\n" + ",\n".join(inside) + "\n}"
    if depth and isinstance(doc, list) and doc:
        return "[\n" + ",\n".join(_written(v, depth - 1) for v in doc) + "\n]"
    return json.dumps(doc, separators=(",", ":"), ensure_ascii=False)


def files() -> dict[str, str]:
    """Every file's name and text."""
    made: dict[str, list[Case]] = {
        "valid.json": valid(),
        "invalid.json": invalid(),
        "lossy.json": lossy(),
        "alternating.json": alternating(),
    }
    return {k: _written({"schemas": SCHEMAS, "cases": v}, 4) + "\n" for k, v in made.items()}
