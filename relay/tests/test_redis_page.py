"""The configuration of docs/how-to/scale/redis.md is one that Redis takes and that a relay can use."""

from __future__ import annotations

import re

import redis

from .operator_pages import DOCS
from .redis_server import Redis

PAGE = (DOCS / "how-to/scale/redis.md").read_text(encoding="utf-8")


def test_redis_runs_as_the_page_configures_it(redis_server: Redis) -> None:
    (block,) = re.findall(r"^```text\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    wanted = dict(line.split(" ", 1) for line in block.splitlines())
    with redis.Redis.from_url(redis_server.url, decode_responses=True) as client:
        for name, value in wanted.items():
            client.config_set(name, value.strip('"'))
        client.auth(wanted["requirepass"])
        found = {name: client.config_get(name)[name] for name in wanted}
    assert found == wanted | {"save": "", "maxmemory": str(512 << 20)}
