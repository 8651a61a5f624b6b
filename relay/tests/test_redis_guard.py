"""The scripts that keep an older state from replacing a newer one, in a real Redis; their Python twins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import pytest
import redis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from posecast_relay.redis.client import channel, generation_key, state_key, status_key, writer_key
from posecast_relay.redis.directory import BOARD, KEYS
from posecast_relay.redis.scripts import CLAIM, GUARD, INCOMPLETE, LEASE_MS, OUTRUN, REFUSED, STATUS, STORED
from posecast_testing import count_examples

from .redis_server import Redis
from .sim_redis_data import Data

STATE, COUNTER, WRITER = state_key("r", "public"), generation_key("r"), writer_key("r")
OTHER, STANDING, CHANNEL = state_key("r", "other"), status_key("r"), channel("r")


class Guarded:
    """The scripts in a real Redis."""

    def __init__(self, server: Redis) -> None:
        self.client: Any = redis.Redis(port=server.port, socket_timeout=5)
        self.script = {text: self.client.register_script(text) for text in (CLAIM, GUARD, STATUS, BOARD)}

    def claim(self, *states: str) -> int:
        """A new generation."""
        return int(self.script[CLAIM]([COUNTER, WRITER, *(states or (STATE,))], ["1"]))

    def write(
        self, generation: int, seq: int, full: bool = True, key_id: int = 7, frame: bytes = b"f"
    ) -> int:
        """A state."""
        args = [generation, seq, "1" if full else "0", key_id, b"told", "frame", frame]
        return int(self.script[GUARD]([STATE, COUNTER, CHANNEL, WRITER], args))

    def tell(self, generation: int, *states: str) -> int:
        """How the robot is."""
        keys = [STANDING, CHANNEL, WRITER, COUNTER, *states]
        return int(self.script[STATUS](keys, [generation, b"standing"]))


@pytest.fixture
def guarded(redis_server: Redis) -> Guarded:
    """An empty Redis."""
    return Guarded(redis_server)


def test_nothing_older_replaces_what_is_newer(guarded: Guarded) -> None:
    first = guarded.claim()
    assert guarded.write(first, 5, full=False) == INCOMPLETE
    assert guarded.write(first, 5) == STORED
    assert guarded.write(first, 6, full=False) == STORED
    assert guarded.write(first, 7, full=False, key_id=8) == INCOMPLETE
    assert (
        guarded.write(first, 5, full=False) == OUTRUN
    )  # one that was under way while later ones were written
    second = guarded.claim()
    assert second > first
    assert guarded.write(second, 0, full=False) == INCOMPLETE
    assert guarded.write(second, 0, key_id=9, frame=b"new") == STORED
    assert guarded.write(first, 99, frame=b"retired") == REFUSED
    assert guarded.tell(first) == REFUSED
    assert guarded.client.hget(STATE, "frame") == b"new"
    assert int(guarded.client.get(COUNTER)) == second


def test_a_state_whose_writer_is_gone_mutes_nobody(guarded: Guarded) -> None:
    late = guarded.claim()
    assert guarded.write(late, 5) == STORED
    guarded.client.delete(COUNTER, WRITER)  # as when Redis evicts them
    assert guarded.write(late - 10, 5) == OUTRUN
    again = guarded.claim()
    assert again > late
    assert guarded.write(again, 0) == STORED


def test_who_hears_no_frames_claims_nothing_that_another_writes(guarded: Guarded) -> None:
    mine = guarded.claim()
    keys = [COUNTER, WRITER, STATE]
    assert guarded.script[CLAIM](keys, ["0"]) == REFUSED
    guarded.client.delete(WRITER)
    assert guarded.script[CLAIM](keys, ["0"]) > mine


@pytest.mark.parametrize("left", ["no end", "too long"])
def test_a_lease_that_no_process_holds_mutes_nobody(guarded: Guarded, left: str) -> None:
    mine = guarded.claim()
    guarded.client.set(WRITER, mine + 5, px=None if left == "no end" else 10 * LEASE_MS)
    assert guarded.write(mine, 1) == STORED
    assert guarded.tell(mine, STATE) == STORED


def test_redis_clock_stepped_back_mutes_nobody(guarded: Guarded) -> None:
    ahead = math.floor(guarded.claim() * 1.5)
    guarded.client.hset(STATE, mapping={"generation": ahead, "seq": 1, "key_id": 7})
    assert guarded.claim() == ahead + 1
    guarded.client.delete(STATE)
    assert guarded.claim() == ahead + 2
    guarded.client.flushall()
    assert guarded.claim() < ahead


def test_the_lease_is_as_long_as_two_signs_of_life_and_renewed_by_each(guarded: Guarded) -> None:
    mine = guarded.claim()
    renewals: list[Callable[[], int]] = [
        lambda: guarded.write(mine, 1),
        lambda: guarded.tell(mine),
        guarded.claim,
    ]
    for renew in renewals:
        guarded.client.pexpire(WRITER, 1)
        renew()
        assert 1000 < guarded.client.pttl(WRITER) <= LEASE_MS


@pytest.mark.parametrize("lost", [STATE, OTHER, COUNTER])
def test_the_writer_learns_what_was_lost_by_telling_how_the_robot_is(guarded: Guarded, lost: str) -> None:
    mine = guarded.claim()
    assert guarded.write(mine, 1) == STORED
    guarded.client.hset(OTHER, "generation", mine)
    assert guarded.tell(mine, STATE, OTHER) == STORED
    guarded.client.delete(lost)
    assert guarded.tell(mine, STATE, OTHER) == INCOMPLETE


@pytest.mark.parametrize("kind", ["string", "hash", "list"])
@pytest.mark.parametrize("spoilt", [STATE, COUNTER, WRITER, STANDING, *KEYS])
def test_what_is_of_another_type_is_replaced(guarded: Guarded, spoilt: str, kind: str) -> None:
    put = {"string": ("set", "x"), "hash": ("hset", "x", "y"), "list": ("rpush", "x")}[kind]
    guarded.client.execute_command(put[0], spoilt, *put[1:])
    mine = guarded.claim()
    assert guarded.write(mine, 1) == STORED
    assert guarded.tell(mine, STATE) == STORED
    guarded.script[BOARD](KEYS, ["process", "1", "{}", "r", "{}"])
    assert guarded.client.hget(STATE, "frame") == b"f"
    assert int(guarded.client.get(COUNTER)) == int(guarded.client.get(WRITER)) == mine
    assert guarded.client.get(STANDING) == b"standing"
    assert [guarded.client.type(key) for key in KEYS] == [b"hash"] * 3


@pytest.mark.parametrize(
    "odd", ["", "x", "-1", "1e999", "nan", "inf", "0x10p99", "9" * 5000, "1.5", "\udcff"]
)
def test_a_number_that_is_none_counts_as_none(guarded: Guarded, odd: str) -> None:
    text = odd.encode(errors="surrogateescape")
    for name in ("generation", "seq", "key_id"):
        guarded.client.hset(STATE, name, text)
    guarded.client.set(COUNTER, text)
    guarded.client.set(WRITER, text)
    mine = guarded.claim()
    assert guarded.write(mine, 1) == STORED
    assert guarded.write(mine, 2, full=False) == STORED


@pytest.mark.parametrize("odd", ["", "x", ".", "1.2.3", " {}", "1e999 {}", "9999999999999 {}", "\xff"])
def test_a_row_of_the_board_that_is_none_is_taken_away(guarded: Guarded, odd: str) -> None:
    for key in KEYS:
        guarded.client.hset(key, "odd", odd)
    found = guarded.script[BOARD](KEYS, ["process", "1", "{}", "r", "{}"])
    assert [rows[::2] for rows in found[1:]] == [[b"r"], [b"process"], [b"process"]]
    assert all(guarded.client.hget(key, "odd") is None for key in KEYS)


# ---- the same in Python, by which histories are simulated ------------------------

steps = st.lists(
    st.one_of(
        st.tuples(
            st.just("claim"),
            st.tuples(st.sampled_from("01"), st.lists(st.sampled_from([STATE, OTHER]), unique=True)),
        ),
        st.tuples(
            st.just("guard"),
            st.tuples(st.sampled_from([STATE, OTHER]), st.integers(-3, 3), st.integers(0, 3), st.booleans()),
        ),
        st.tuples(
            st.just("status"), st.tuples(st.integers(-3, 3), st.lists(st.sampled_from([STATE, OTHER])))
        ),
        st.tuples(st.just("delete"), st.sampled_from([STATE, OTHER, COUNTER, WRITER, STANDING])),
        st.tuples(st.just("set"), st.sampled_from([STATE, OTHER, COUNTER, WRITER, STANDING])),
        st.tuples(st.just("hset"), st.sampled_from([STATE, OTHER, COUNTER, WRITER, STANDING])),
    ),
    max_size=25,
)


@settings(
    max_examples=count_examples(150),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(steps=steps)
def test_the_twins_answer_alike_and_leave_the_same(
    guarded: Guarded, steps: Sequence[tuple[str, Any]]
) -> None:
    """Real generations follow a clock that the twins don't share: each side counts from its own newest."""
    guarded.client.flushall()
    twin = Data(lambda: 5.0, lambda _channel, _message: None)
    newest = [0, 0]  # of the real one, of the twin

    for what, about in steps:
        if what == "claim":
            hears, states = about
            real = int(guarded.script[CLAIM]([COUNTER, WRITER, *states], [hears]))
            made = twin.claim([COUNTER, WRITER, *states], [hears])
            assert (real > 0) == (made > 0)
            newest = [real, made] if made else newest
        elif what == "guard":
            state, apart, seq, full = about
            keys = [state, COUNTER, CHANNEL, WRITER]
            rest = [seq, "1" if full else "0", 7, b"told", "frame", b"f"]
            answers = [
                int(guarded.script[GUARD](keys, [max(0, newest[0] + apart), *rest])),
                twin.guard(keys, [max(0, newest[1] + apart), *rest]),
            ]
            assert answers[0] == answers[1]
        elif what == "status":
            apart, states = about
            keys = [STANDING, CHANNEL, WRITER, COUNTER, *states]
            answers = [
                int(guarded.script[STATUS](keys, [max(0, newest[0] + apart), b"standing"])),
                twin.status(keys, [max(0, newest[1] + apart), b"standing"]),
            ]
            assert answers[0] == answers[1]
        elif what == "delete":
            guarded.client.delete(about)
            twin.delete(about)
        elif what == "set":
            guarded.client.set(about, "odd")
            twin.set(about, "odd", 1e9)
        else:
            guarded.client.delete(about)
            guarded.client.hset(about, "odd", "odd")
            twin.delete(about)
            twin.hset(about, "odd", "odd")
        if 0 < guarded.client.pttl(WRITER) <= LEASE_MS:
            guarded.client.pexpire(WRITER, LEASE_MS)  # however slow this machine is
        kinds = {b"string": bytes, b"hash": dict}
        for key in (STATE, OTHER, COUNTER, WRITER, STANDING):
            there = kinds.get(guarded.client.type(key))
            assert there is (None if twin.value(key) is None else type(twin.value(key))), key
