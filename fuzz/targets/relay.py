"""What a relay reads: of edges, of viewers' requests, of other relays, of its own file."""

from __future__ import annotations

import asyncio
import functools
import hashlib
import json

from posecast_relay.auth.addresses import find_real_address, may_show, parse_networks
from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import RobotsError
from posecast_relay.core.limits import Limits
from posecast_relay.core.messages import read_edge_message
from posecast_relay.core.policy import make_link, read_link
from posecast_relay.core.stream import Stream
from posecast_relay.http.previews import Thumbnails
from posecast_relay.models.cache import Absent, ModelCache, Unavailable
from posecast_relay.models.picture import PICTURE_TYPES, SIDE_PX_MAX, PictureError, read_picture_size
from posecast_relay.net.request import BadRequest, NoSuchStream, read_bearer, read_target
from posecast_relay.past.address import (
    EVERY_STEPS,
    AddressError,
    PastSpan,
    read_after,
    read_every,
    read_index,
    read_sha256,
    read_span,
    read_take,
    write_day,
    write_minute,
)
from posecast_relay.past.documents import make_page
from posecast_relay.past.segment import pack_record, unpack_record
from posecast_relay.redis.messages import pack, unpack, unpack_state
from posecast_wire import Snapshot

from fuzz.differ import difference
from fuzz.page_reader import ask
from fuzz.scratch import file_of
from fuzz.target import Differs, Target

LIMITS = Limits()
PROXIES = parse_networks("10.0.0.0/8, ::1")
ORIGINS = ("https://course.example",)
KEY = "k" * 43
NOW_S = 1_800_000_000.25


def said(data: bytes) -> None:
    """What a relay takes of an edge reaches the page as it was said."""
    doc = read_edge_message(data, LIMITS)
    if doc is None:
        return
    if doc["type"] == "event":
        stream = Stream("demo", "public", LIMITS)
        text = stream.number_event(doc, NOW_S).text
        seen = ask("message", text.encode())
        wanted = {name: doc[name] for name in ("type", "t", "level", "source", "text", "state")}
        apart = difference(wanted | {"n": 1, "at": NOW_S}, seen)
    else:
        seen = ask("message", json.dumps(doc).encode())
        apart = difference({name: doc[name] for name in ("type", "kv", "hash") if name in doc}, seen)
        if doc["type"] == "model":
            apart = difference(doc["hash"], seen and seen.get("hash"))
    if apart is not None:
        raise Differs(f"the page sees another {doc['type']}: {apart}")


def absorbed(data: bytes) -> None:
    """A snapshot is taken as a whole or changes nothing; what is taken can be told to viewers."""
    snapshot = Snapshot.unpack(data)
    stream = Stream("demo", "public", LIMITS)
    try:
        stream.apply_snapshot(snapshot, 1, 0.0)
    except ValueError:
        if (stream.version, stream.schema, stream.key, stream.info) != (0, None, None, {}):
            raise Differs("refused, and yet something changed") from None
        raise
    stream.make_description(0)
    json.dumps(stream.info, ensure_ascii=False).encode()


def relayed(data: bytes) -> None:
    """What is taken can be packed, and is then the same."""
    packed = pack(unpack(data))
    if pack(unpack(packed)) != packed:
        raise Differs("packed it is another")


def state(data: bytes) -> None:
    """A hash of Redis: lines `name=value`, each ended by a zero byte."""
    entries = [entry.partition(b"=") for entry in data.split(b"\0")]
    found = unpack_state({name: value for name, _, value in entries})
    found.snapshot.pack()


def past_record(data: bytes) -> None:
    """What is taken can be packed, and is then the same; an index of it is JSON."""
    found = unpack_record("r", "public", data)
    if pack_record(unpack_record("r", "public", pack_record(found))) != pack_record(found):
        raise Differs("packed it is another")
    json.loads(make_page("public", PastSpan(0, 600_000), [found]))


def request(data: bytes) -> None:
    """A request's target, as latin-1, as HTTP has it."""
    found = read_target(data.decode("latin-1"))
    found.check()
    if not 0 <= found.hz <= 1000:
        raise Differs(f"{found.hz} Hz")


def past_address(data: bytes) -> None:
    """A part of an address of the past, as UTF-8: none, or what it says comes back as it was. `every` alone
    may come back smaller, because the relay limits it.
    """
    text = data.decode("utf-8", "replace")
    said, refusal = [], None
    try:
        every = read_every(text)
    except AddressError:
        pass
    else:
        if not (f"{every}" == text or EVERY_STEPS == every < int(text)):
            raise Differs(f"every={text!r} is read as {every}")
    for read in (read_span, read_take, read_index, read_after, read_sha256):
        try:
            said.append(read(text))
        except AddressError as e:
            refusal = e
    for found in said:
        if isinstance(found, PastSpan):
            again = write_day(found.from_ms) if found.is_day else write_minute(found.from_ms)
        elif isinstance(found, bytes):
            again = found.hex()
        elif isinstance(found, tuple):
            again = f"{found[0]:016x},{found[1]}"
        else:
            again = f"{found:016x}" if len(text) == 16 else f"{found}"
        if again != text:
            raise Differs(f"{text!r} is read as {again}")
    if not said and refusal is not None:
        raise refusal


def headers(data: bytes) -> None:
    """Lines: X-Forwarded-For, Authorization, Origin, Host."""
    lines = [*data.decode("latin-1").split("\n"), "", "", "", ""]
    if "," in find_real_address("10.1.2.3", lines[0], PROXIES):
        raise Differs("a list as an address")
    find_real_address(lines[0], lines[1], PROXIES)
    token = read_bearer(lines[1])
    if token is not None:
        read_link(token, {"demo": KEY}, NOW_S)
    if may_show(lines[2], lines[3], ORIGINS) and lines[2] not in ORIGINS:
        origin, _, host = lines[2].partition("://")
        if origin not in ("http", "https") or host != lines[3]:
            raise Differs("another page may show it")


def link(data: bytes) -> None:
    """A share link: only the one that was signed is good."""
    good = make_link(KEY, "demo", int(NOW_S) + 10, "abcdefgh")
    text = data.decode("utf-8", "replace")
    if read_link(text, {"demo": KEY}, NOW_S) is not None and text != good:
        raise Differs("a forged link")


def robots(data: bytes) -> None:
    """The file of `--robots`."""
    found = read_robots(file_of(data, "robots.toml"))
    found.find_secrets(NOW_S)
    found.find_link_keys()
    found.make_policy()


class _OneManifest:
    """A ModelSource that has this manifest and no file."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def offers(self, robot: str, digest: str) -> bool:  # noqa: ARG002
        return True

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:  # noqa: ARG002
        return self._data

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:  # noqa: ARG002
        return b""


@functools.cache
def loop() -> asyncio.Runner:
    """One for all cases: to make one takes longer than a case."""
    return asyncio.Runner()


def manifest(data: bytes) -> None:
    """A model's manifest, a file that it names, and its small picture."""
    digest = hashlib.sha256(data).hexdigest()

    async def read() -> None:
        models = ModelCache(_OneManifest(data), 1 << 20)
        for path in [*await models.load_entries("demo", digest)][:3]:
            await models.load_file("demo", digest, path)
        await Thumbnails(models).load_picture("demo", digest)

    loop().run(read())


def picture(data: bytes) -> None:
    """A picture is of one type at most, and of a size that somebody can unpack."""
    sizes, refusals = [], []
    for type_ in PICTURE_TYPES:
        try:
            sizes.append(read_picture_size(data, type_))
        except PictureError as e:
            refusals.append(e)
    if not sizes:
        raise refusals[0]
    (size,) = sizes
    assert all(1 <= side <= SIDE_PX_MAX for side in size)


TARGETS = (
    Target("edge-said", said, stretched=1 << 15, page=True),
    Target("absorbed", absorbed, (ValueError,), stretched=1 << 18, corpus="snapshot"),
    Target("relayed", relayed, (ValueError,), stretched=1 << 18),
    Target("relayed-state", state, (ValueError,), stretched=1 << 18),
    Target("past-record", past_record, (ValueError,), stretched=1 << 18),
    Target("request", request, (BadRequest, NoSuchStream)),
    Target("past-address", past_address, (AddressError,)),
    Target("headers", headers),
    Target("link", link),
    Target("robots-file", robots, (RobotsError,), stretched=1 << 17),
    Target("model-manifest", manifest, (Unavailable, Absent), stretched=1 << 18, corpus="manifest"),
    Target("picture", picture, (PictureError,), stretched=1 << 18),
)
