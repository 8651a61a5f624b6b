"""The routes of the past over real sockets: who gets what, when, and how it may be cached."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
import threading
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
from posecast_relay.core.policy import HIDDEN, Audience, Rule
from posecast_relay.net.answer_cache import AnswerCache
from posecast_relay.past import documents, routes, service
from posecast_relay.past.segment import KeptSegment
from posecast_wire.key_page import decode_key_page, encode_key_page
from posecast_wire.segment import decode_segment

from .past_doors import DAY, PAGE, PAGE_MS, SCHEMA, SCHEMA_HASH, TAKE, PastDoors, address_of, link

A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
OPEN = {"r": {A: Rule()}}
EACH = {"r": {A: Rule(past_s=600), S: Rule("lab", past_s=600), L: Rule("late", delay_s=10, past_s=600)}}
ROUTES = ("", DAY, PAGE, f"{PAGE}/keys", f"{TAKE:016x}/0", f"schema/{SCHEMA_HASH.hex()}")
TOKENS = {A: None, S: "somebody", L: link("r")}
VIEWS = {A: "public", S: "lab", L: "late"}


@pytest.fixture
async def doors() -> AsyncIterator[PastDoors]:
    """Open to anyone."""
    async with PastDoors(OPEN) as found:
        yield found


def path_of(route: str, view: str) -> str:
    """A route, for a view."""
    return f"{view}/{route}" if route else f"?view={view}"


def shows(answer: httpx.Response, segment: KeptSegment) -> bool:
    """Whether anything of a segment is in an answer that was given."""
    if answer.status_code != 200:
        return False
    document: dict[str, Any] = {}
    if answer.headers["content-type"] == "application/json":
        document = answer.json()
    elif answer.content.startswith(b"\x89PCK"):
        return any(pose.index == segment.name.index for pose in decode_key_page(answer.content).poses)
    listed = [entry["index"] for entry in document.get("segments", ())]
    return (
        answer.content in (segment.data, SCHEMA.text.encode())
        or segment.name.index in listed
        or bool(document.get("minutes") or document.get("days"))
    )


async def ask_all(doors: PastDoors, audience: Audience, view: str) -> list[httpx.Response]:
    """Every route, as this audience."""
    return [await doors.ask(path_of(route, view), TOKENS[audience]) for route in ROUTES]


async def test_what_there_is(doors: PastDoors) -> None:
    first = doors.keep(0, PAGE_MS)
    second = doors.keep(1, PAGE_MS + 70_000)
    doors.unix_ms = PAGE_MS + 100_000
    summary = await doors.ask("")
    assert summary.json() == {
        "view": "public",
        "from_ms": PAGE_MS,
        "to_ms": PAGE_MS + 74_000,
        "past_ms": 1_800_000,
        "delay_ms": 0,
        "newest": {"take": f"{TAKE:016x}", "index": 1},
        "days": [DAY],
        "deleted": [],
    }
    documents.PastSummary.model_validate_json(summary.content)
    day = await doors.ask(f"public/{DAY}")
    documents.PastDay.model_validate_json(day.content)
    assert day.json()["minutes"] == [
        {"minute": minute, "bytes": len(each.data), "frames": 1, "word": "online", "faults": 1}
        for minute, each in (("2026-11-18T11:20Z", first), ("2026-11-18T11:21Z", second))
    ]
    page = await doors.ask(f"public/{PAGE}")
    documents.PastPage.model_validate_json(page.content)
    entry = page.json()["segments"][1]
    assert entry["sha256"] == hashlib.sha256(second.data).hexdigest()
    assert entry["schema"] == SCHEMA_HASH.hex()
    assert entry["events"] == [{"at_ms": PAGE_MS + 70_002, **json.loads(second.events[0].text)}]
    assert (entry["run"], entry["missing"], entry["words"]) == (
        "000000000000000e",
        9,
        [{"at_ms": PAGE_MS + 70_000, "word": "online"}],
    )
    newer = (await doors.ask(f"public/{PAGE}?after={TAKE:016x},0")).json()
    assert [entry["index"] for entry in newer["segments"]] == [1]
    bytes_ = await doors.ask(address_of(second))
    assert decode_segment(bytes_.content).start.index == 1
    keys = decode_key_page((await doors.ask(f"public/{PAGE}/keys")).content)
    assert [(pose.index, pose.seq) for pose in keys.poses] == [(0, 0), (1, 10)]
    one = decode_key_page((await doors.ask(f"public/{PAGE}/keys?every=2")).content)
    assert [pose.index for pose in one.poses] == [0]
    assert (await doors.ask(f"public/schema/{SCHEMA_HASH.hex()}")).text == SCHEMA.text


@pytest.mark.parametrize("step_s", [0.000_001, 0.3, 0.6])
async def test_an_answer_that_expires_during_its_request_is_never_empty(
    doors: PastDoors, step_s: float
) -> None:
    """Each read of the clock is later than the one before."""
    kept = doors.keep(0, PAGE_MS)
    doors.unix_ms = PAGE_MS + 100_000
    now = [0.0]

    def read_clock() -> float:
        now[0] += step_s
        return now[0]

    doors.service.answers = AnswerCache(read_clock)
    for path in ("", f"public/{DAY}", f"public/{PAGE}"):
        first = await doors.ask(path)
        assert shows(first, kept) or first.json()["from_ms"] == kept.from_ms
        for _ in range(8):
            now[0] = max(now[0], now[0] // 1 + 1 - 1.5 * step_s)  # close to the end of the second
            assert (await doors.ask(path)).content == first.content, path


async def test_an_index_that_would_be_too_long_goes_on_after_its_last_segment(
    doors: PastDoors, monkeypatch: pytest.MonkeyPatch
) -> None:
    for index in range(5):
        doors.keep(index, PAGE_MS + 4000 * index)
    doors.unix_ms = PAGE_MS + 60_000
    whole = await doors.ask(f"public/{PAGE}")
    assert not whole.json()["more"]
    monkeypatch.setattr(documents, "INDEX_BYTES_MAX", len(whole.content) // 2)
    got: list[int] = []
    after, more = "", True
    while more:
        doors.now += 2
        page = (await doors.ask(f"public/{PAGE}{after}")).json()
        got += [entry["index"] for entry in page["segments"]]
        after, more = f"?after={TAKE:016x},{got[-1]}", page["more"]
    assert got == [0, 1, 2, 3, 4]


async def test_a_cursor_that_is_not_on_the_page_leads_on_and_loses_nothing(doors: PastDoors) -> None:
    """The second take begins while the first goes on, as where two relays hear a robot."""
    for take, index, at_s in ((1, 0, -2), (1, 1, 0), (1, 2, 4), (2, 0, 6), (1, 4, 12), (2, 1, 14)):
        doors.keep(index, PAGE_MS + 1000 * at_s, take=take)
    doors.unix_ms = PAGE_MS + 60_000

    async def ask(take: int, index: int) -> list[tuple[int, int]]:
        doors.now += 2
        page = (await doors.ask(f"public/{PAGE}?after={take:016x},{index}")).json()
        return [(int(entry["take"], 16), entry["index"]) for entry in page["segments"]]

    whole = [(1, 1), (1, 2), (2, 0), (1, 4), (2, 1)]
    assert await ask(1, 2) == whole[2:]
    assert await ask(1, 0) == whole  # of the page before
    assert await ask(1, 3) == whole[2:]  # not for them, or damaged: what came after the one before it
    assert await ask(1, 400) == whole[4:]  # not known here yet, as at a gateway that is a moment behind
    assert await ask(2, 400) == []
    assert await ask(3, 0) == whole  # of a relay that has started again since, or of another robot
    doors.past.drop_oldest("r")
    doors.past.drop_oldest("r")
    assert await ask(1, 1) == whole[1:]  # dropped meanwhile


async def test_what_came_after_one_of_a_page_that_is_over_is_cached_as_the_page_is(doors: PastDoors) -> None:
    for index in range(2):
        doors.keep(index, PAGE_MS + 4000 * index)
    for at_ms, fresh in ((609_999, "1"), (1_388_000, "1, s-maxage=10"), (1_795_000, "1, s-maxage=5")):
        doors.unix_ms = PAGE_MS + at_ms
        for after in ("", *(f"?after={TAKE:016x},{index}" for index in range(3))):
            answer = await doors.ask(f"public/{PAGE}{after}")
            assert answer.headers["cache-control"] == f"public, max-age={fresh}", (at_ms, after)


@pytest.mark.parametrize("audience", list(Audience))
async def test_before_during_and_after_a_blackout(audience: Audience) -> None:
    async with PastDoors(EACH) as doors:
        view, dark = VIEWS[audience], {**EACH["r"], audience: Rule(blackout=True)}
        doors.unix_ms = PAGE_MS + 30_000
        before = doors.keep(0, PAGE_MS, view=view)
        assert before.audiences == {audience}
        answers = await ask_all(doors, audience, view)
        assert [answer.status_code for answer in answers] == [200] * len(ROUTES)
        assert all(shows(answer, before) for answer in answers)
        for other in Audience:
            if audience not in (A, other):  # what anyone may see is for the others as well
                assert {answer.status_code for answer in await ask_all(doors, other, view)} == {403}
        doors.allow({"r": dark})
        during = doors.keep(1, PAGE_MS + 4000, view=view)
        assert during.audiences == frozenset()
        for answer in await ask_all(doors, audience, view):
            assert answer.status_code in (403, 404)
            # so that a crowd that goes on asking is one request a second and cache
            kept = "public, max-age=1" if audience is A else "private, no-store"
            assert ("access-control-expose-headers" in answer.headers) == (audience is A)
            assert answer.headers["cache-control"] == kept
            assert answer.headers.get("vary") == ("authorization" if audience is A else None)
        doors.allow(EACH)
        after = doors.keep(2, PAGE_MS + 8000, view=view)
        page = await doors.ask(f"{view}/{PAGE}", TOKENS[audience])
        assert [entry["index"] for entry in page.json()["segments"]] == [0, 2]
        keys = await doors.ask(f"{view}/{PAGE}/keys", TOKENS[audience])
        assert [pose.index for pose in decode_key_page(keys.content).poses] == [0, 2]
        day = (await doors.ask(f"{view}/{DAY}", TOKENS[audience])).json()["minutes"]
        assert [minute["frames"] for minute in day] == [2]
        assert (await doors.ask(address_of(before), TOKENS[audience])).content == before.data
        assert (await doors.ask(address_of(after), TOKENS[audience])).content == after.data
        hole = await doors.ask(address_of(during), TOKENS[audience])
        assert hole.json() == {"next": {"take": f"{TAKE:016x}", "index": 2}}


@pytest.mark.parametrize("audience", list(Audience))
async def test_what_fell_due_in_a_blackout_is_never_seen(audience: Audience) -> None:
    """Whoever sees it 10 s late, at any point of it, could not see it live."""
    lit = {"r": {audience: Rule(delay_s=10, past_s=600)}}
    async with PastDoors(lit) as doors:
        for index in range(5):  # the last one ends 20 s after the first began
            doors.keep(index, PAGE_MS + 4000 * index)
        doors.unix_ms = PAGE_MS + 20_000
        doors.allow({"r": {audience: Rule(delay_s=10, past_s=600, blackout=True)}})
        doors.unix_ms += 1000
        doors.allow(lit)
        doors.keep(6, PAGE_MS + 21_001)
        doors.unix_ms += 120_000
        doors.now += 2
        page = (await doors.ask(f"public/{PAGE}", TOKENS[audience])).json()
        assert [entry["index"] for entry in page["segments"]] == [
            0,
            1,
            6,
        ]  # what was due until then, and after
        for index in (2, 3, 4):
            answer = await doors.ask(f"public/{TAKE:016x}/{index}", TOKENS[audience])
            assert answer.json()["next"]["index"] == 6


async def test_rules_that_changed_while_the_relay_was_down_open_nothing_of_before() -> None:
    """What is kept longer than a process bears who could see it; the file of today alone opens nothing."""
    async with PastDoors({"r": {S: Rule(past_s=600)}}) as doors:
        private = doors.keep(0, PAGE_MS)
        doors.unix_ms = PAGE_MS + 10_000
        doors.allow({"r": {A: Rule(past_s=600), S: Rule(past_s=600), L: Rule(past_s=600)}})
        for audience in (A, L):
            for answer in await ask_all(doors, audience, "public"):
                assert not shows(answer, private), answer.url
                assert private.data not in answer.content
        assert (await doors.ask(address_of(private), "somebody")).content == private.data
        doors.allow({"r": {A: Rule(past_s=600), S: Rule(past_s=0)}})
        assert (await doors.ask(address_of(private), "somebody")).status_code == 404
        doors.allow({"r": {A: Rule(past_s=600), S: Rule(hz=10)}})
        assert (await doors.ask(address_of(private), "somebody")).status_code == 404


async def test_nobody_is_given_an_answer_that_was_made_for_another_audience() -> None:
    async with PastDoors({"r": {A: Rule(past_s=600), S: Rule(past_s=600)}}) as doors:
        private = doors.keep(0, PAGE_MS, audiences=frozenset({S}))
        doors.unix_ms = PAGE_MS + 10_000
        for audience in (S, A, S):  # within a second
            for answer in (await ask_all(doors, audience, "public"))[:4]:
                assert shows(answer, private) == (audience is S), answer.url


async def test_what_is_delayed_is_seen_in_its_own_time() -> None:
    async with PastDoors({"r": {A: Rule(delay_s=10, past_s=60)}}) as doors:
        first, second = doors.keep(0, PAGE_MS), doors.keep(1, PAGE_MS + 4000)
        for at_ms, seen in ((13_999, []), (14_000, [0]), (17_999, [0]), (18_000, [0, 1])):
            doors.unix_ms = PAGE_MS + at_ms
            doors.now += 2
            page = (await doors.ask(f"public/{PAGE}")).json()
            assert [entry["index"] for entry in page["segments"]] == seen, at_ms
            newest = (await doors.ask("")).json()
            assert newest["delay_ms"] == 10_000
            assert newest["to_ms"] == (PAGE_MS + 4000 * len(seen) if seen else None)
        assert (await doors.ask(address_of(first))).headers["cache-control"] == "public, max-age=52"
        doors.unix_ms = PAGE_MS + 17_000
        held = asyncio.create_task(doors.ask(address_of(second)))
        await doors.until_held(1)
        doors.unix_ms = PAGE_MS + 18_000
        assert (await held).content == second.data
        doors.unix_ms = PAGE_MS + 70_001
        assert (await doors.ask(address_of(first))).json()["next"]["index"] == 1


async def test_what_anyone_may_see_is_cached_until_it_leaves_the_window_and_an_hour_at_most() -> None:
    async with PastDoors({"r": {A: Rule(past_s=7200), S: Rule("lab")}}) as doors:
        segment = doors.keep(0, PAGE_MS)
        for at_s, fresh in ((4, 3600), (3600, 3600), (3601, 3599), (7199, 1), (7200, 1)):
            doors.unix_ms = PAGE_MS + 1000 * at_s
            for path in (address_of(segment), f"public/schema/{SCHEMA_HASH.hex()}"):
                answer = await doors.ask(path)
                assert answer.status_code == 200
                assert answer.headers["cache-control"] == f"public, max-age={fresh}", (at_s, path)
        doors.unix_ms += 1
        assert (await doors.ask(address_of(segment))).status_code == 404
        doors.now += 2
        assert (await doors.ask("")).json()["newest"] is None
        doors.unix_ms = PAGE_MS + 600_000
        for closed, shared in ((False, ""), (True, ", s-maxage=10")):
            doors.unix_ms = PAGE_MS + (610_000 if closed else 609_999)
            for path in (f"public/{PAGE}", f"public/{PAGE}/keys"):
                assert (await doors.ask(path)).headers["cache-control"] == f"public, max-age=1{shared}", path


async def test_pages_of_keys_are_made_one_after_the_other_and_not_for_ever_more(
    doors: PastDoors, monkeypatch: pytest.MonkeyPatch
) -> None:
    doors.keep(0, PAGE_MS)
    doors.unix_ms = PAGE_MS + 10_000
    let = threading.Event()
    patched = "posecast_relay.past.service.encode_key_page"
    monkeypatch.setattr(patched, lambda *page: let.wait(20) and encode_key_page(*page))
    asked = [asyncio.create_task(doors.ask(f"public/{PAGE}/keys")) for _ in range(service.WAITING_MAX + 5)]
    done: set[asyncio.Task[httpx.Response]] = set()
    while len(done) < 5:
        done |= (await asyncio.wait(set(asked) - done, return_when=asyncio.FIRST_COMPLETED, timeout=10))[0]
    assert {(each.result().status_code, each.result().headers["retry-after"]) for each in done} == {
        (503, "1")
    }
    let.set()
    statuses = [answer.status_code for answer in await asyncio.gather(*asked)]
    assert statuses.count(200) == service.WAITING_MAX
    assert (await doors.ask(f"public/{PAGE}/keys")).status_code == 200


async def test_headers_head_and_etags(doors: PastDoors) -> None:
    doors.allow({"r": {A: Rule(), S: Rule("lab")}})
    doors.keep(0, PAGE_MS)
    doors.keep(0, PAGE_MS, view="lab")
    doors.unix_ms = PAGE_MS + 10_000
    for audience, view in ((A, "public"), (S, "lab")):
        for route in ROUTES:
            path = path_of(route, view)
            asked = {"origin": "https://elsewhere.example"} if audience is A else {}
            got = await doors.ask(path, TOKENS[audience], accept_encoding="gzip, br", **asked)
            assert got.status_code == 200, path
            assert "vary" not in got.headers
            assert "content-encoding" not in got.headers
            if audience is A:
                assert got.headers["access-control-allow-origin"] == "*"
                assert (
                    got.headers["access-control-expose-headers"] == "age, date, etag, retry-ms, retry-after"
                )
                assert got.headers["cache-control"].startswith("public, max-age=")
            else:
                assert "access-control-allow-origin" not in got.headers
                assert got.headers["cache-control"] == "private, no-store"
            head = await doors.ask(path, TOKENS[audience], "HEAD")
            assert (head.status_code, head.content) == (200, b"")
            assert head.headers["content-length"] == str(len(got.content))
            for known in (got.headers["etag"], f'"other", {got.headers["etag"]}', "*"):
                again = await doors.ask(path, TOKENS[audience], if_none_match=known)
                assert (again.status_code, again.content) == (304, b""), (path, known)
                assert again.headers["etag"] == got.headers["etag"] == head.headers["etag"]
            other = await doors.ask(path, TOKENS[audience], if_none_match='"other"')
            assert other.status_code == 200
    assert (await doors.ask(f"lab/{PAGE}", "somebody", origin="https://elsewhere.example")).status_code == 403


NEVER_WERE = {
    400: (
        *("public/2026-02-30", "public/1970-01-01", "public/2026-11-18T11:25Z", "public/2026-11-18T24:00Z"),
        *("public/9999999-01-01", "public/2026-11-18T11:20", "public/%00", "public/a", "public/२०२६-११-१८"),
        *(f"public/{TAKE:016X}/0", f"public/{TAKE:x}/0", f"public/{'0' * 4000}/0"),
        *(f"public/{TAKE:016x}/{index}" for index in ("-1", "01", "4294967296", "1e3", "9" * 400, "x")),
        *(f"public/{PAGE}/keys?every={every}" for every in ("0", "-1", "1001", "", "1.5", "9" * 300)),
        *(f"public/{PAGE}?after={after}" for after in ("", "1", ",", f"{TAKE:016x}", f"{TAKE:016x},-1")),
        *(f"public/schema/{sha}" for sha in ("0", "z" * 64, "A" * 64)),
        *("?token=x", "?view=", f"public/{DAY}/keys"),
    ),
    404: (
        *(f"public/{TAKE:016x}/7", f"public/{TAKE:016x}/4294967295", f"public/{'f' * 16}/0"),
        *(
            f"public/schema/{'0' * 64}",
            "/none/past/*/2026-11-18",
            "/none%2f/past",
            "public/..%2f",
            "public/a/b/c",
            "nothing",
        ),
    ),
    403: (f"lab/{PAGE}", f"lab/{TAKE:016x}/0", "?view=lab", "?view=*", "%2a/2026-11-18"),
    200: (
        *("public/2000-01-01", "public/2099-12-31", "public/2098-11-18T23:50Z"),
        *("public/2099-11-18T23:50Z/keys?every=1000", f"public/{PAGE}?after={'0' * 16},0"),
    ),
}


@pytest.mark.parametrize("status", list(NEVER_WERE))
async def test_what_never_was(doors: PastDoors, status: int) -> None:
    doors.keep(0, PAGE_MS)
    doors.unix_ms = PAGE_MS + 5000
    for path in NEVER_WERE[status]:
        answer = await doors.ask(path)
        assert answer.status_code == status, path
        assert status == 200 or "\n" not in answer.json()["error"], path
        kept = "private, no-store" if "token" in path else "public, max-age=1"
        assert status != 400 or answer.headers["cache-control"] == kept, path
    assert (await doors.ask("")).json()["newest"]["index"] == 0


async def test_an_address_that_lacks_something_is_told_what_there_is(doors: PastDoors) -> None:
    doors.keep(0, PAGE_MS)
    for path in ("/r/past/", "public", "public/", f"public/{DAY}/", "public/a/b/c/d"):
        answer = await doors.ask(path)
        assert (answer.status_code, answer.json()["error"]) == (404, routes.NO_ROUTE), path
    for form in re.findall(r"VIEW/[A-Z\d/a-z]+", routes.NO_ROUTE):
        names = {"VIEW": "public", "DAY": DAY, "MINUTES": PAGE, "TAKE": f"{TAKE:016x}", "INDEX": "0"}
        path = "/".join(({"SHA256": SCHEMA_HASH.hex()} | names).get(part, part) for part in form.split("/"))
        doors.unix_ms = PAGE_MS + 5000
        assert (await doors.ask(path)).status_code == 200, path


async def test_a_robot_that_is_hidden_is_as_one_that_is_not() -> None:
    async with PastDoors(
        {"r": {A: Rule()}, "hidden": {S: Rule()}, "dark": {A: Rule(blackout=True)}}
    ) as doors:
        for robot in ("r", "hidden"):
            doors.keep(0, PAGE_MS, robot=robot)
        doors.unix_ms = PAGE_MS + 5000
        for route in ROUTES:
            answers = set()
            for robot in ("hidden", "dark", "none"):
                got = await doors.ask(f"/{robot}/past/{path_of(route, 'public')}".replace("/?", "?"))
                kept = {name: value for name, value in got.headers.items() if name != "date"}
                answers.add((got.status_code, got.text, str(kept)))
            assert len(answers) == 1, route
            assert answers.pop()[:2] == (404, json.dumps({"error": HIDDEN}, separators=(",", ":")))


async def test_without_a_file_anyone_looks_back_on_what_was_heard_and_nothing_else_is_there() -> None:
    async with PastDoors(None) as doors:
        doors.keep(0, PAGE_MS)
        doors.unix_ms = PAGE_MS + 5000
        assert (await doors.ask("")).json()["newest"]["index"] == 0
        assert (await doors.ask("/other/past")).status_code == 404


async def test_the_api_describes_them(doors: PastDoors) -> None:
    document = doors.app.openapi()
    for path, methods in document["paths"].items():
        assert "422" not in methods["get"]["responses"], path
    paths = {path: it for path, it in document["paths"].items() if "/past" in path}
    assert len(paths) == len(ROUTES) - 1  # a day and ten minutes are one
    for path, methods in paths.items():
        answers = methods["get"]["responses"]
        assert {"304", "400", "401", "403", "404", "503"} <= answers.keys(), path
        assert ("501" in answers) == ("{view}" in path), path
        assert answers["200"].get("content"), path


async def test_what_fails_at_the_past_keeps_no_viewer_its_old_rights(doors: PastDoors) -> None:
    def fail(_: object) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        doors.access.on_policy(fail)
    doors.allow({"r": {A: Rule(blackout=True)}})
    assert doors.access.live.faults == {"ZeroDivisionError": 1}
