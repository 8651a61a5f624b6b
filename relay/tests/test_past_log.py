"""What a process says of its past: at its start, when the rules change, and when memory is full."""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.config.settings import parse
from posecast_relay.core.policy import Audience, Policy, Rule
from posecast_relay.past.deletions import Deletions
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past_command.deletion import make_deletion
from posecast_relay.server.past import CROWD_EVERY_S, ObedientMemory, PastLog, describe_past

from .past_doors import PAGE_MS, make_kept
from .test_robots_command import robots

ARCHIVE = ("--past", "file:///srv/past")
A, S = Audience.ANYONE, Audience.SIGNED_IN


@pytest.mark.parametrize(
    ("flags", "policy", "told"),
    [
        ((), Policy(), "the past: 30 min in memory, up to 256 MB"),
        (
            ("--past-memory", "1G"),
            Policy({"r": {A: Rule(past_s=86400.0)}}),
            "the past: 1 d in memory, up to 1024",
        ),
        (("--past", "0"), Policy(), "the past: off (--past 0)"),
        ((), Policy({"r": {A: Rule(past_s=0.0)}}), "the past: nothing is kept, because nobody may look back"),
        (("--role", "gateway", "--store", "redis://x"), Policy(), "the past: from Redis"),
        (
            (*ARCHIVE, "--role", "gateway", "--store", "redis://x"),
            Policy(),
            "the past: from Redis; before that from file:///srv/past",
        ),
        (
            ARCHIVE,
            Policy(),
            "the past: 30 min in memory, up to 256 MB; nothing in file:///srv/past: `keep` needs a file of",
        ),
        (
            ARCHIVE,
            Policy({"r": {A: Rule()}}),
            "the past: 30 min in memory, up to 256 MB; nothing in file:///srv/past: no robot has `keep`",
        ),
        (
            ARCHIVE,
            Policy({"r": {A: Rule(past_s=864000.0)}}, {"r": 2592000.0}),
            "the past: 31 min in memory, up to 256 MB; in file:///srv/past: r 30 d",
        ),
        (
            ARCHIVE,
            Policy({"hubo": {S: Rule(past_s=0.0)}, "r": {A: Rule()}}, {"hubo": 2592000.0, "r": 86400.0}),
            "the past: 30 min in memory, up to 256 MB; in file:///srv/past: r 1 d; keep of 'hubo' has no "
            "effect: nobody may look back; give an audience `past`",
        ),
        (
            ARCHIVE,
            Policy({"r": {A: Rule(past_s=0.0), S: Rule("lab", past_s=86400.0)}}, {"r": 86400.0}),
            "the past: 31 min in memory, up to 256 MB; in file:///srv/past: r 1 d; view 'public': keep of "
            "'r' has no effect: nobody may look back",
        ),
    ],
)
def test_a_line_at_the_start_says_what_is_kept(flags: tuple[str, ...], policy: Policy, told: str) -> None:
    assert describe_past(parse(["run", "--dev", *flags], {}), policy).startswith(told)


def test_a_folder_made_just_now_is_new() -> None:
    policy = Policy({"r": {A: Rule()}}, {"r": 86400.0})
    told = describe_past(parse(["run", "--dev", *ARCHIVE], {}), policy, is_new=True)
    assert told.endswith("; in file:///srv/past (new, empty): r 1 d")


def test_a_relay_that_starts_says_it(relays: Any) -> None:
    relays().line(r"^the past: 30 min in memory, up to 256 MB\n")


def test_a_change_of_the_rules_is_a_line_for_each_robot_and_audience(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    said = PastLog()
    said.follow(Policy({"r": {A: Rule(), S: Rule("lab")}, "other": {A: Rule()}}))
    said.follow(Policy({"r": {A: Rule(blackout=True), S: Rule("lab", past_s=60.0)}, "other": {A: Rule()}}))
    said.follow(Policy({"r": {A: Rule(past_s=0.0), S: Rule("lab", past_s=60.0)}, "new": {A: Rule()}}))
    assert caplog.messages == [
        "r, anyone: blackout begins",
        "r, signed-in: may look back 1 min",
        "r, anyone: blackout ends",
        "r, anyone: may no longer look back",
    ]


def test_keep_that_comes_and_goes_is_told(caplog: pytest.LogCaptureFixture) -> None:
    said, rules = PastLog(), {"r": {A: Rule()}}
    for keeps_s in ({}, {"r": 86400.0}, {"r": 86400.0}, {}):
        said.follow(Policy(rules, keeps_s))
    kept, gone = caplog.messages
    assert kept == "r: the store keeps its past for 1 d"
    assert gone.startswith(
        "r: `keep` was removed: nothing more is written to the store, and existing data stays"
    )


def test_keep_without_effect_is_told_on_each_change(caplog: pytest.LogCaptureFixture) -> None:
    said, keeps_s = PastLog(), {"hubo": 86400.0}
    for past_s in (0.0, 0.0, None):
        said.follow(Policy({"hubo": {S: Rule(past_s=past_s)}}, keeps_s if past_s == 0.0 else {}))
    caplog.clear()
    policy = Policy({"hubo": {S: Rule(past_s=0.0)}}, keeps_s)
    said.follow(policy)
    told = "keep of 'hubo' has no effect: nobody may look back; give an audience `past`"
    assert caplog.messages == [told]
    said.follow(policy)
    assert caplog.messages == [told]
    said.follow(Policy({"hubo": {S: Rule(past_s=0.0), A: Rule(past_s=0.0)}}, keeps_s))
    assert caplog.messages == [told, told]


def test_who_crowds_the_memory_is_named_once_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    cost = make_kept(0, PAGE_MS).cost_bytes
    past, said = MemoryPast(20 * cost), PastLog()
    past.add(make_kept(0, PAGE_MS, robot="small"), 0.0)
    for n in range(60):
        past.add(make_kept(n, PAGE_MS + 4000 * n, robot="large"), 4.0 * n)
        said.report_crowding(past, 4.0 * n)
    first, *more = caplog.messages
    assert first.startswith(
        "the past: memory is full (--past-memory, 0 MB): large uses most of it, lost its "
    )
    assert first.endswith("reaches back 68 s")
    assert len(more) == (60 - 18) * 4 // CROWD_EVERY_S
    assert not any("small" in line for line in caplog.messages)


def test_robots_add_says_who_may_look_back(tmp_path: Path) -> None:
    path = tmp_path / "robots.toml"
    open_, private = (robots(path, "add", *more).stderr for more in (("hubo",), ("g1", "--private")))
    assert "Who can watch 'hubo': anyone: public (30 min back)." in open_
    assert "Who can watch 'g1': nobody." in private


def test_a_deletion_is_a_line_at_the_default_level(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    kept, deletions = MemoryPast(1 << 26), Deletions()
    ObedientMemory(kept, deletions)
    kept.add(make_kept(0, PAGE_MS), 0.0)
    deletions.add(make_deletion("r", None, PAGE_MS, PAGE_MS + 1000, time.time_ns() // 1_000_000))
    deletions.add(make_deletion("old", None, PAGE_MS, PAGE_MS + 1000, PAGE_MS))
    span = "2026-11-18T11:20:00Z to 2026-11-18T11:20:01Z"
    assert caplog.messages == [f"past delete: r, all views, {span}: deleted 1 segment from memory"]
