"""What a robot may say beside its frames: events, texts, models, answers."""

from __future__ import annotations

import hashlib
import itertools
import json
import time

from posecast_wire import Encoder, fnv1a32

from tests.attack.by_frames import AS_FAST_AS_IT_GOES
from tests.attack.hostile_crowd import Crowd, get, stream
from tests.attack.hostile_robot import JOINTS, Robot, key_frame, schema_of, snapshot_text
from tests.attack.target import Steps, Target, attack

LONE = "\ud800"
EVENT = {"type": "event", "t": 1.0, "level": "fault", "source": "RKN", "text": "jam", "state": "on"}
BASE_36 = "0123456789abcdefghijklmnopqrstuvwxyz"


def doubled(labels: int) -> str:
    """The text of a schema that names its first label again at its end: only that is wrong with it."""
    names = ["".join(digits) for digits in itertools.islice(itertools.product(BASE_36, repeat=4), labels - 1)]
    fields = [{"name": "pos", "labels": "joint", "scale": 0.001}]
    doc = {"type": "schema", "v": 1, "robot": "r", "labels": {"joint": [*names, names[-1]]}, "fields": fields}
    return json.dumps(doc, separators=(",", ":"))


def ask_for(robot: Robot, seq: itertools.count[int]) -> None:
    """A KEY of a schema that is not here: the relay asks for the snapshot."""
    robot.put(key_frame(0xDEAD, next(seq), 200))


@attack()
def doubled_names(at: Target) -> Steps:
    """schemas of 20,000 labels, and of 37,000 (256 KiB), with one duplicate label"""
    seq, turns = itertools.count(1), itertools.count()
    texts = [doubled(20_000), doubled(37_000)]
    answers = [snapshot_text(text, key_frame(fnv1a32(text.encode()), 1, 200)) for text in texts]
    yield
    robot = Robot(at)
    robot.answers = lambda: [answers[next(turns) % 2]]
    return at.paced(20, lambda: ask_for(robot, seq)) + f" asked, {robot.asked} answered"


@attack()
def strange_words(at: Target) -> Steps:
    """events, texts and labels with 1e999, 5,000 digits, nesting, BOMs, direction marks: 1,000 a second"""
    marks = "\u202e\u2066\u200b\ufeff\u0301\u2028\U000e0041"
    robot = Robot(at, schema=schema_of(JOINTS, f"{marks}J")).on_air()
    depth = "[" * 900 + "]" * 900
    values = ["1e999", "-1e999", "9" * 1900, "NaN", depth, "null", '"1"', "true", "-0", "5e-324"]
    said = [
        f'{{"type":"event","t":{value},"level":"fault","source":"s","text":"x","state":"on"}}'.encode()
        for value in values
    ]
    said += [b"", b"\xff\xfe", b"null", b"[]", b'{"type":"event"}', b"\xef\xbb\xbf{}", b"{" * 2000]
    said += [b'{"type":"info","kv":{"a":1}}', b'{"type":"info","kv":[]}', b'{"type":"model","hash":7}']
    said.append(json.dumps(EVENT | {"text": marks * 20, "source": marks}).encode())
    said.append(json.dumps({"type": "info", "kv": {marks: marks * 50}}).encode())
    turns = itertools.cycle(said)
    yield
    return at.paced(1000, lambda: robot.tell(next(turns)))


@attack()
def surrogates_in_events(at: Target) -> Steps:
    """events with half a surrogate pair in their text, 500 a second"""
    robot = Robot(at).on_air()
    yield
    return at.paced(500, lambda: robot.tell(EVENT | {"text": LONE}))


@attack()
def surrogates_in_texts(at: Target) -> Steps:
    """half surrogate pairs in info, snapshots and schema names, while clients request list and document"""
    robot = Robot(at).on_air()
    asks = [get("/api/v1/robots"), get("/api/v1/robots/rude"), get("/api/v1/robots/rude/state")]
    crowd = Crowd(at, lambda n: asks[n % 3])
    crowd.open(range(9))
    seq = itertools.count(10_000)
    yield
    robot.answers = lambda: [
        snapshot_text(robot.schema.text, robot.frame(key=True), '{"a":"\\ud800","\\udfff":"b"}')
    ]

    def tell() -> None:
        robot.tell({"type": "info", "kv": {"name": LONE, LONE: "x"}})
        robot.tell({"type": "model", "hash": LONE * 64})
        ask_for(robot, seq)
        crowd.reopen()
        for number in crowd.sockets:
            crowd.write(number, asks[number % 3])

    return at.paced(50, tell)


@attack()
def events_unpaced(at: Target) -> Steps:
    """events of one robot with 20 viewers, at full speed"""
    robot = Robot(at).on_air()
    crowd = Crowd(at, lambda _n: stream("rude", "hz=1"))
    crowd.open(range(20))
    crowd.until_heard()
    yield

    def tell() -> None:
        robot.tell(EVENT)
        crowd.reopen()

    return at.paced(AS_FAST_AS_IT_GOES, tell)


@attack()
def models_and_texts(at: Target) -> Steps:
    """a new model and info 1,000 times a second; 20 viewers request each model"""
    robot = Robot(at).on_air()
    robot.model_answer = lambda _part, _range: b"{}"
    crowd = Crowd(at, lambda _n: stream("rude", "hz=1"))
    crowd.open(range(20))
    asking = Crowd(at, lambda _n: b"")
    asking.open(range(20))
    crowd.until_heard()
    n = itertools.count()
    yield

    def tell() -> None:
        count = next(n)
        digest = hashlib.sha256(str(count).encode()).hexdigest()
        robot.tell({"type": "model", "hash": digest})
        robot.tell({"type": "info", "kv": {"n": f"{count}{'x' * 1900}"}})
        crowd.reopen()
        asking.reopen()
        asking.write(count % 20, get(f"/api/v1/robots/rude/model/{digest}/manifest.json"))

    return at.paced(1000, tell)


@attack()
def snapshots_of_100_mb(at: Target) -> Steps:
    """an answer of 100 MB to every snapshot query"""
    seq = itertools.count(1)
    huge = snapshot_text("x" * 50_000_000, key_frame(1, 1, 200), '{"a":"' + "y" * 50_000_000 + '"}')
    yield
    robot = Robot(at)
    robot.answers = lambda: [huge]
    return at.paced(20, lambda: ask_for(robot, seq)) + f" asked, {robot.asked} answered"


@attack()
def a_thousand_answers(at: Target) -> Steps:
    """1,000 answers of 100 kB to one snapshot query, repeatedly"""
    seq = itertools.count(1)
    schema = schema_of(4096)
    key = Encoder(schema).encode([5] * 4096, 1, 1.0, 1.0)
    answer = snapshot_text(schema.text, key, '{"a":"' + "y" * 10_000 + '"}')
    yield
    robot = Robot(at)
    robot.answers = lambda: [answer] * 1000
    return at.paced(20, lambda: ask_for(robot, seq)) + f" asked, {1000 * robot.asked:,} answers"


@attack()
def widest_schemas(at: Target) -> Steps:
    """20 robots that answer each query with another valid schema of 4,096 channels and 250 kB"""
    seq, n = itertools.count(1), itertools.count()
    texts = [schema_of(4096, f"{name}{'x' * 48}") for name in range(8)]
    keys = [Encoder(schema).encode([5] * 4096, 1, 1.0, 1.0) for schema in texts]

    def answer() -> list[bytes]:
        turn = next(n) % len(texts)
        return [snapshot_text(texts[turn].text, keys[turn])]

    yield
    robots = [Robot(at, f"rude-{name}") for name in range(20)]
    for robot in robots:
        robot.answers = answer

    def ask() -> None:
        for robot in robots:
            ask_for(robot, seq)

    return at.paced(10, ask) + f" asked, {sum(robot.asked for robot in robots)} answered"


def declared(files: list[tuple[str, str]]) -> bytes:
    """A manifest of these files: path, and size as it stands in the text."""
    listed = [
        f'{{"path":"{path}","uri":"u","size":{size},"sha256":"{n:064x}","type":"model/stl"}}'
        for n, (path, size) in enumerate(files, 1)
    ]
    return f'{{"v":1,"urdf":"{files[0][0]}","files":[{",".join(listed)}],"missing":[]}}'.encode()


def offers(robot: Robot, manifest: bytes) -> str:
    """Announces a model; the digest of its manifest. Of its files it answers any range."""
    digest = hashlib.sha256(manifest).hexdigest()
    robot.model = digest
    chunk = bytes(250_000)

    def answer(part: str, of: dict[str, str]) -> bytes | None:
        return manifest if part == "manifest" else chunk[: int(of["len"] or 0)]

    robot.model_answer = answer
    robot.on_air()
    robot.tell({"type": "model", "hash": digest})
    return digest


@attack(seconds=2.4)
def models_of_250_mb(at: Target) -> Steps:
    """40 declared files of 250 MB requested at once, by clients that leave after a second"""
    robot = Robot(at)
    digest = offers(robot, declared([(f"{n}.stl", "250000000") for n in range(40)]))
    crowd = Crowd(at, lambda n: get(f"/api/v1/robots/rude/model/{digest}/{n}.stl"))
    yield
    crowd.open(range(40))
    left = [False]

    def look() -> None:
        crowd.read()
        if not left[0] and at.end_s - 1 < time.monotonic():
            left[0] = True
            for number in list(crowd.sockets):
                crowd.drop(number)

    at.paced(20, look)
    return f"{crowd.opened} askers"


@attack()
def sizes_of_1e999(at: Target) -> Steps:
    """manifests with sizes of 1e999, −1, 0.5, 5,000 digits, true, null or a text: 100 requests a second"""
    sizes = ["1e999", "-1", "0.5", "9" * 5000, "true", "null", '"7"', "[]", "1e300", "-1e999"]
    robot = Robot(at)
    digests = {}
    for size in sizes:
        manifest = declared([("a.stl", size)])
        digests[hashlib.sha256(manifest).hexdigest()] = manifest
    offered = itertools.cycle(digests)
    robot.on_air()
    robot.model_answer = lambda part, _of: digests[robot.model or ""] if part == "manifest" else b"x"
    crowd = Crowd(at, lambda _n: b"")
    crowd.open(range(20))
    turns = itertools.count()
    yield

    def ask() -> None:
        robot.model = next(offered)
        robot.tell({"type": "model", "hash": robot.model})
        crowd.reopen()
        for path in ("manifest.json", "a.stl"):
            crowd.write(next(turns) % 20, get(f"/api/v1/robots/rude/model/{robot.model}/{path}"))

    return at.paced(50, ask)
