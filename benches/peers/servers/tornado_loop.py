"""Tornado, which rosbridge serves browsers with: `write_message()` for each viewer in turn."""

from __future__ import annotations

import asyncio

from tornado.httpserver import HTTPServer
from tornado.web import Application
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from relay.benches.feed import frames, listen, options
from relay.benches.stamps import Stamps

viewers: set[Live] = set()


class Live(WebSocketHandler):  # type: ignore[misc]  # Tornado is not in this environment
    """One viewer."""

    def check_origin(self, origin: str) -> bool:  # noqa: ARG002
        return True

    def open(self) -> None:
        self.set_nodelay(True)
        viewers.add(self)

    def on_message(self, message: str | bytes) -> None:
        pass

    def on_close(self) -> None:
        viewers.discard(self)

    def data_received(self, chunk: bytes) -> None:
        pass


async def main() -> None:
    asked = options()
    listener = listen()
    listener.setblocking(False)
    HTTPServer(Application([("/live", Live)])).add_sockets([listener])
    async for data in frames(asked.hz, asked.bytes, Stamps(asked.stamps)):
        for viewer in list(viewers):
            try:
                viewer.write_message(data, binary=True)
            except WebSocketClosedError:
                viewers.discard(viewer)


if __name__ == "__main__":
    asyncio.run(main())
