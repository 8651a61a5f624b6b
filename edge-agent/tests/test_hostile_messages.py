"""Messages that once ended an agent, held it up, or filled its memory: counted and dropped."""

from __future__ import annotations

import json
import logging
import os
import struct
import threading
from pathlib import Path
from typing import Any

import ach_stage
import cbor2
import pytest
import ros_stage
from message_parsers import MESSAGE, as_cbor, doubling, publish
from parser_stage import held_bytes
from posecast_edge.kit import NAMED_MAX, RateLimitedLog
from posecast_edge.sources.hubo.ach_shm import AchChannel, ChannelError
from posecast_edge.sources.hubo.achd import BatchTimer
from posecast_edge.sources.ros.cdr import CdrReader
from posecast_edge.sources.ros.input import RosInput
from posecast_edge.sources.ros.merge import MessageMerger
from posecast_edge.sources.ros.messages import (
    DIAGNOSTICS,
    JOINT_STATE,
    STRING,
    Report,
    RosMessageError,
    get_text,
    read_message,
)
from posecast_edge.sources.ros.ros2 import BACKLOG_MAX, Inbox
from posecast_edge.sources.ros.rosbridge import RosbridgeConnection
from posecast_edge.sources.ros.rosbridge_protocol import (
    MESSAGE_MAX,
    MessageAssembler,
    Publish,
    RosbridgeProtocolError,
)
from recording_parsers import WALKER


def joint_states(**members: object) -> dict[str, object]:
    return {**MESSAGE, **members}


def nested(depth: int) -> object:
    inner: object = []
    for _ in range(depth):
        inner = [inner]
    return inner


BAD: dict[str, dict[str, object]] = {
    "a name without end": {"name": ["A", "x" * 201]},
    "a number without end": {"position": [10**400, 1.0]},
    "a list in a list": {"position": [nested(5000), 1.0]},
    "numbers without end": {"position": [0.0] * 5000},
    "a stamp beyond all time": {"header": {"stamp": {"sec": 10**300, "nanosec": 0}, "frame_id": ""}},
    "a stamp of 5,000 digits": {"header": {"stamp": {"sec": 10**4999, "nanosec": 0}, "frame_id": ""}},
}


@pytest.mark.parametrize("case", BAD)
def test_parts_that_are_left_out(case: str) -> None:
    report = read_message(JOINT_STATE, joint_states(**BAD[case]))
    assert report.values
    (line,) = report.left_out.values()
    assert len(line) < 200
    assert line.isprintable()


def test_texts_are_cut() -> None:
    status = {"name": "n" * 1000, "level": 1, "message": "m" * 100_000}
    report = read_message("diagnostic_msgs/DiagnosticArray", joint_states(status=[status]))
    assert report.info == {"n" * 200: "m" * 200}
    assert list(report.values["diag"]) == ["n" * 200]


def test_half_a_character_is_no_description() -> None:
    with pytest.raises(RosMessageError, match="half of a surrogate pair"):
        get_text({"data": "<robot name='\ud800'/>"})
    intake = RosInput("robot", None)
    with pytest.raises(RosMessageError, match="half of a surrogate pair"):
        intake.take_urdf("<robot name='\ud800'/>")


def test_a_payload_too_large_is_not_decoded() -> None:
    cdr = CdrReader()
    with pytest.raises(RosMessageError, match="too large"):
        cdr.read(JOINT_STATE, b"\0\1\0\0" + bytes(1 << 19))
    assert get_text(cdr.read(STRING, ros_stage.text_message("x" * (1 << 19)))) == "x" * (1 << 19)


@pytest.mark.parametrize("count", [1 << 20, (1 << 31) - 1, (1 << 32) - 1])
def test_a_sequence_that_claims(count: int) -> None:
    payload = ros_stage.Cdr().header(5.0).put("I", count).done() + bytes(1000)
    cdr = CdrReader()

    def read() -> None:
        with pytest.raises(RosMessageError):
            cdr.read(JOINT_STATE, payload)

    assert held_bytes(read) < 1 << 20


def test_publishers_that_are_ever_new_push_each_other_out() -> None:
    merge = MessageMerger(True, lambda line: None)
    for k in range(300):
        names = {f"{k}.{i}": 1.0 for i in range(4000)}
        merge.take_report(f"/t{k}", "pos", JOINT_STATE, Report(k + 1.0, {"pos": names}), k / 1000)
    sample = merge.make_sample(0.3)
    assert sample is not None
    assert 4000 <= len(sample.values["pos"]) <= 16384


def test_channels_told_twice_are_a_few_lines() -> None:
    said: list[str] = []
    merge = MessageMerger(True, said.append)
    for k in range(100):
        merge.take_report(f"/t{k}", "pos", JOINT_STATE, Report(k + 1.0, {"pos": {"A": 1.0}}), k / 1000)
    assert len(said) == 8
    assert said[-1].endswith("further ones are not logged")


def test_bad_messages_of_a_thousand_topics_are_a_few_lines(caplog: pytest.LogCaptureFixture) -> None:
    intake = RosInput("robot", None)
    for k in range(1000):
        intake.take_message(f"/t{k}/joint_states", JOINT_STATE, lambda: {"name": 5})
    assert len(caplog.messages) == NAMED_MAX + 2
    assert caplog.messages[-1].startswith("100 more bad messages, the newest: /t199/joint_states: ")


def test_a_decoder_that_raises_costs_its_message(caplog: pytest.LogCaptureFixture) -> None:
    intake = RosInput("robot", WALKER)

    def decode() -> object:
        raise ZeroDivisionError("of the decoder's own")

    intake.take_message("/joint_states", JOINT_STATE, decode)
    assert "of the decoder's own" in caplog.text
    intake.take_message("/joint_states", JOINT_STATE, joint_states)
    assert intake.make_sample() is not None


def test_messages_without_content_take_room_too() -> None:
    inbox = Inbox()
    for _ in range(BACKLOG_MAX // 400):
        inbox.put("/x", JOINT_STATE, b"")
    taken, lost = inbox.take(0.0)
    assert len(taken) + lost == BACKLOG_MAX // 400
    assert lost > 0


# --- rosbridge


def fragment(name: object, data: str, number: int = 0, total: int = 4000) -> str:
    return json.dumps({"op": "fragment", "id": name, "data": data, "num": number, "total": total})


def test_fragments_are_bounded_together() -> None:
    ear = MessageAssembler()
    piece = fragment("x", "y" * (MESSAGE_MAX // 2)).replace('"x"', '"{}"', 1)

    def feed() -> None:
        for k in range(12):
            ear.feed(piece.replace("{}", str(k)))

    assert held_bytes(feed) < 4 * MESSAGE_MAX
    whole = json.dumps({"op": "status", "level": "error", "msg": "good"})
    assert ear.feed(fragment("good", whole[:9], 0, 2)) is None
    assert ear.feed(fragment("good", whole[9:], 1, 2)) is not None


@pytest.mark.parametrize("name", ["x" * 5000, 10**30, None, ["a"], 1.5])
def test_a_fragment_of_a_strange_name(name: object) -> None:
    with pytest.raises(RosbridgeProtocolError, match="an invalid fragment"):
        MessageAssembler().feed(fragment(name, "x"))


def test_a_number_of_thousands_of_digits_is_no_name() -> None:
    """CBOR has such numbers, and Python can't write them."""
    number = b"\xc2\x59\x20\x00" + b"\xff" * 8192
    for key in ("id", "level", "msg"):
        said = b"\xa4" + cbor2.dumps("op") + cbor2.dumps("service_response" if key == "id" else "status")
        said += cbor2.dumps(key) + number + cbor2.dumps("a") + b"\0" + cbor2.dumps("b") + b"\0"
        MessageAssembler().feed(said)
    whole = {"op": "fragment", "data": "x", "num": 0, "total": 2}
    said = cbor2.dumps(whole)
    with pytest.raises(RosbridgeProtocolError):
        MessageAssembler().feed(b"\xa5" + said[1:] + cbor2.dumps("id") + number)


def test_lists_that_hold_a_list_twice_are_not_written_out() -> None:
    heard = MessageAssembler().feed(doubling(150))
    assert isinstance(heard, Publish)
    report = read_message(JOINT_STATE, heard.message)
    assert max(map(len, report.left_out.values())) < 200


@pytest.mark.parametrize(
    "value",
    [
        "c1fb7e37e43c8800759c",  # a date in the year 1e292
        "d81e820100",  # 1/0
        "c5821b7fffffffffffffff03",  # 3 · 2^(2^63)
        "c4821b7fffffffffffffff03",
        "d8236a28617b302c39397d292a",  # a regular expression
        "d82461783a",
        "d81c81d81d00",  # a list in itself
        "d9010481a0",
    ],
)
def test_tags_that_are_not_read(value: str) -> None:
    try:
        heard = MessageAssembler().feed(as_cbor(bytes.fromhex(value)))
    except RosbridgeProtocolError as e:
        assert str(e).isprintable()  # noqa: PT017
        return
    assert isinstance(heard, Publish)
    with pytest.raises(RosMessageError):
        read_message(JOINT_STATE, heard.message)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (publish([[]] * 300_000), "JSON of more than 250,000 values"),
        (b"\x9a\x00\x20\x00\x00" + b"\xa0" * (2 << 20), "CBOR of"),
        (as_cbor(b"\xd8\x40\x5a\x00\x02\x00\x00" + bytes(2 << 16)), "typed array"),
        ("[" * 1_000_00, "nested too deep"),
        ('{"op": ' + "9" * 5000 + "}", "a message without op"),
    ],
)
def test_messages_that_would_grow(data: str | bytes, reason: str) -> None:
    def feed() -> None:
        with pytest.raises(RosbridgeProtocolError, match=reason):
            MessageAssembler().feed(data)

    assert held_bytes(feed) < 8 << 20


class Connection:
    """A server's messages, as many as it is asked for."""

    def __init__(self, data: list[str]) -> None:
        self.data = data
        self.sent: list[dict[str, Any]] = []

    def recv(self, _timeout: float) -> str:
        if not self.data:
            raise TimeoutError
        return self.data.pop(0)

    def send(self, said: str) -> None:
        self.sent.append(json.loads(said))


def talk(connection: Connection, encoding: str = "json") -> RosbridgeConnection:
    words = RateLimitedLog(logging.getLogger("words").warning, "words")
    return RosbridgeConnection(connection, RosInput("robot", None), encoding, True, words)  # type: ignore[arg-type]


def test_a_batch_is_bounded_in_characters() -> None:
    told = talk(Connection(["x" * (8 << 20)] * 8))
    assert sum(map(len, told._newest())) <= 32 << 20
    assert len(talk(Connection(["x"] * 1000))._newest()) == 256


@pytest.mark.parametrize("value", ["[" * 100_000, '"\\ud800"', json.dumps("x" * (9 << 20))])
def test_a_parameter_that_is_no_description_is_told(value: str, caplog: pytest.LogCaptureFixture) -> None:
    answer = {"op": "service_response", "id": "description", "values": {"value": value}, "result": True}
    talk(Connection([]))._receive(json.dumps(answer))
    assert len(caplog.messages) == 1
    assert len(caplog.messages[0]) < 500


def test_a_description_is_asked_for_as_json() -> None:
    """It may be larger than CBOR is read."""
    connection = Connection([])
    told = talk(connection, "cbor")
    values = {"topics": ["/robot_description", "/diagnostics"], "types": [STRING, DIAGNOSTICS]}
    told._receive(json.dumps({"op": "service_response", "id": "topics", "values": values, "result": True}))
    wishes = {s["topic"]: s.get("compression") for s in connection.sent if s["op"] == "subscribe"}
    assert wishes == {"/robot_description": None, "/diagnostics": "cbor"}


# --- ACH


def test_frames_that_claim_the_channel(tmp_path: Path) -> None:
    """A channel of 60 MB, of which each of 60 entries claims all."""
    path = tmp_path / "channel"
    writer = ach_stage.Writer(path, frames=60, frame_size=1 << 20)
    channel = AchChannel(path)
    writer.put(bytes(100))
    assert len(channel.read_new_frames()) == 1
    for i in range(60):
        struct.pack_into("<QQQ", writer.map, writer.index + 24 * i, 60 << 20, 0, 100 + i)
    struct.pack_into("<Q", writer.map, 120, 0)

    def look() -> None:
        with pytest.raises(ChannelError, match="its index points at byte 0"):
            channel.read_new_frames()

    assert held_bytes(look) < 1 << 20


def test_a_pipe_is_no_channel(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    failed = threading.Event()

    def look() -> None:
        with pytest.raises(OSError, match="seek"):
            AchChannel(tmp_path / "pipe")
        failed.set()

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    thread.join(10)
    assert failed.is_set()


@pytest.mark.parametrize("wanted_s", [1e308, float("inf"), 1e-300])
def test_a_batch_that_has_no_end(wanted_s: float) -> None:
    rhythm = BatchTimer()
    rhythm.record_batch(1, 0.0)
    rhythm.record_batch(1, 5e-324)
    assert 1 <= rhythm.compute_batch(wanted_s) <= 1 << 16


def test_a_payload_that_is_cut_off_is_named_in_our_own_words() -> None:
    with pytest.raises(RosMessageError) as caught:
        CdrReader().read(JOINT_STATE, b"\0\1\0\0garbage")
    assert str(caught.value) == "11 bytes that are not a sensor_msgs/JointState, or cut off"
