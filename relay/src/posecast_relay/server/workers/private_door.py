"""Receives forwarded requests in the first worker, on a Unix socket; a header has the client's address."""

from __future__ import annotations

from functools import partial
from typing import Any

from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import find_real_address
from posecast_relay.server.workers.forwarder import PEER
from posecast_relay.streaming.http_connection import HEALTH, HttpConnection, make_plain_http_protocol


def make_private_http_protocol(access: Access) -> type[HttpConnection]:
    """Make the class of connections from further workers. Their requests are queued by the client's address,
    as if they had arrived here.
    """
    base = make_plain_http_protocol(access)

    class Private(base):  # type: ignore[misc, valid-type]
        def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
            peer = self.find_header(cycle, PEER) or ""
            cycle.scope["client"] = (peer, 0)
            trusted = self.access.addresses.trusted
            address = find_real_address(peer, self.find_header(cycle, b"x-forwarded-for"), trusted)
            line = f"{address} health" if cycle.scope["raw_path"] in HEALTH else address
            self.answering = cycle
            self.under_way.wait(self, address, line, partial(self._begin, cycle, app))

    return Private
