"""What an address asks for, whatever stands in it."""

from __future__ import annotations

import gzip
from email.message import Message
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.net.request import (
    BadRequest,
    NoSuchStream,
    StreamRequest,
    choose_encoding,
    read_bearer,
    read_target,
)
from starlette.datastructures import Headers

from .stage import SharedRelay

LIVE = "/api/v1/robots/r/live"


RATES = {"30": 30, "0": 0, "0.0": 0, "-0": 0, "1e-320": 0.1, "7e-320": 0.1, "0.05": 0.1, ".5": 0.5}
LARGE = {"1000": 1000, "1e3": 1000, "%2B5": 5}
NO_RATES = ("nan", "inf", "-inf", "infinity", "-1", "1000.1", "1e999", "1_0", "0x1", "1,5", "1e", "--1")
STRANGE = ("", "%20", "%00", "%D9%A3", "9" * 33, "9" * 5000)


@pytest.mark.parametrize(("wish", "hz"), (RATES | LARGE).items())
def test_rates(wish: str, hz: float) -> None:
    assert read_target(f"{LIVE}?hz={wish}").hz == hz


@pytest.mark.parametrize("wish", NO_RATES + STRANGE, ids=lambda wish: wish[:12])
def test_rates_that_are_none(wish: str) -> None:
    with pytest.raises(BadRequest, match="hz must be a number"):
        read_target(f"{LIVE}?hz={wish}")


def test_no_rate_is_the_usual_one_and_the_first_of_several_counts() -> None:
    assert read_target(LIVE).hz == 30
    assert read_target(f"{LIVE}?hz=5&hz=x").hz == 5


@given(st.text(st.characters(codec="latin-1"), max_size=300))
def test_whatever_the_address_is_it_is_refused_or_sound(query: str) -> None:
    for target in (query, f"{LIVE}?{query}", f"{LIVE}?hz={query}", f"/api/v1/robots/{query}/live"):
        try:
            asked = read_target(target)
        except BadRequest:
            continue
        assert asked.hz == 0 or 0.1 <= asked.hz <= 1000


def test_an_older_page_that_asks_for_a_preview_gets_a_stream_like_any_other() -> None:
    assert read_target(f"{LIVE}?hz=30&preview=1") == read_target(f"{LIVE}?hz=30")


def test_names_are_checked_and_shown_as_what_they_are() -> None:
    with pytest.raises(NoSuchStream) as refused:
        StreamRequest("r\u202e" * 100, None, 1.0, False).check()
    assert str(refused.value).isprintable()
    with pytest.raises(NoSuchStream):
        StreamRequest("r", "*", 1.0, False).check()


def test_too_many_parameters() -> None:
    with pytest.raises(BadRequest, match="16"):
        read_target(f"{LIVE}?" + "&".join(f"a{n}=1" for n in range(17)))


@pytest.mark.parametrize(
    ("header", "token"), [("Bearer x", "x"), ("bearer  x ", "x"), ("Basic x", None), ("Bearer", None)]
)
def test_tokens(header: str, token: str | None) -> None:
    assert read_bearer(header) == token


# ---- who gets files compressed, and how: by the weights of `Accept-Encoding`, asked of a running relay ----


SCRIPT = b"let a = 1;\n" * 1000
BROTLI = b"as Brotli"  # the relay sends what the build made, and does not look into it


@pytest.fixture
def address(relay: SharedRelay) -> str:
    (relay.page / "index.html").write_text("<title>page</title>")
    (relay.page / "assets").mkdir(exist_ok=True)
    for name in ("both.js", "old.js", "plain.js"):
        (relay.page / "assets" / name).write_bytes(SCRIPT)
    (relay.page / "assets/both.js.br").write_bytes(BROTLI)
    for name in ("both.js.gz", "old.js.gz"):
        (relay.page / "assets" / name).write_bytes(gzip.compress(SCRIPT))
    return f"{relay.base}/assets"


def ask(url: str, accepts: str | None, method: str = "GET", **more: str) -> tuple[int, Message, bytes]:
    """Status, headers and body, byte for byte."""
    headers = {name.replace("_", "-"): value for name, value in more.items()}
    if accepts is not None:
        headers["accept-encoding"] = accepts
    try:
        with urlopen(Request(url, headers=headers, method=method), timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except HTTPError as answer:
        return answer.code, answer.headers, answer.read()


@pytest.mark.parametrize(
    ("accepts", "encoding"),
    [
        ("gzip, deflate, br, zstd", "br"),  # browsers over HTTPS
        ("gzip, deflate", "gzip"),  # browsers over HTTP, and proxies
        ("br;q=0.5, gzip;q=0.5", "br"),
        ("br;q=0.4, gzip;q=0.5", "gzip"),
        ("BR ; Q=1.000 , gzip", "br"),
        ("*", "br"),
        ("*;q=0.1, br;q=0", "gzip"),
        ("br;q=0, gzip;q=0", None),
        ("gzip;q=0.5, identity", None),
        ("identity;q=0.5, gzip;q=0.5", "gzip"),
        ("identity;q=0, *;q=0", None),  # nothing is left, and something must be sent
        ("gzip;q=2, br;q=x, br2, notgzip", None),
        ("identity", None),
        ("", None),
        (None, None),
    ],
)
def test_the_client_weighs_and_the_smallest_breaks_a_tie(
    address: str, accepts: str | None, encoding: str | None
) -> None:
    status, headers, body = ask(f"{address}/both.js", accepts)
    assert (status, headers["content-encoding"]) == (200, encoding)
    assert int(headers["content-length"]) == len(body)
    assert (gzip.decompress(body) if encoding == "gzip" else body) == (BROTLI if encoding == "br" else SCRIPT)
    assert headers["content-type"].startswith("text/javascript")
    assert headers["vary"] == "accept-encoding"


def test_only_what_the_build_made_is_offered(address: str) -> None:
    for name, encoding in (("old.js", "gzip"), ("plain.js", None)):
        _, headers, body = ask(f"{address}/{name}", "gzip, br")
        assert (headers["content-encoding"], headers["vary"]) == (encoding, "accept-encoding")
        assert (body if encoding is None else gzip.decompress(body)) == SCRIPT


def test_each_form_has_a_tag_of_its_own_and_is_asked_for_again_by_it(address: str) -> None:
    url, tags = f"{address}/both.js", {}
    for accepts in ("br", "gzip", "identity"):
        _, headers, _ = ask(url, accepts)
        tags[accepts] = headers["etag"]
        status, again, body = ask(url, accepts, if_none_match=headers["etag"])
        assert (status, body, again["etag"], again["vary"]) == (304, b"", headers["etag"], "accept-encoding")
        status, head, body = ask(url, accepts, "HEAD")
        assert (status, body) == (200, b"")
        assert (head["etag"], head["content-encoding"]) == (headers["etag"], headers["content-encoding"])
    assert len(set(tags.values())) == 3
    status, _, body = ask(url, "gzip", if_none_match=tags["br"])
    assert (status, gzip.decompress(body)) == (200, SCRIPT)


def test_a_new_build_is_served_at_once(address: str, relay: SharedRelay) -> None:
    assert ask(f"{address}/both.js", "br")[2] == BROTLI
    Path(relay.page / "assets/both.js.br").write_bytes(b"anew, as Brotli")
    assert ask(f"{address}/both.js", "br")[2] == b"anew, as Brotli"


@given(st.text(st.characters(codec="latin-1"), max_size=100), st.integers(0, 3))
def test_any_header_leads_to_something_that_is_there(text: str, count: int) -> None:
    headers = Headers(raw=[(b"accept-encoding", text.encode("latin-1"))] * count)
    assert choose_encoding(headers, ("br", "gzip")) in ("br", "gzip", None)
    assert choose_encoding(headers, ()) is None


def test_lines_of_one_header_count_together() -> None:
    headers = Headers(raw=[(b"accept-encoding", b"gzip;q=0.5"), (b"accept-encoding", b"br;q=0.7")])
    assert choose_encoding(headers, ("br", "gzip")) == "br"
