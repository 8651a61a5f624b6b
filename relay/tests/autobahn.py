"""Autobahn|Testsuite against the relay's WebSocket stack, by hand: it needs Python 2.7.

    virtualenv -p python2.7 atenv && atenv/bin/pip install autobahntestsuite==25.10.1
    .venv/bin/python -m relay.tests.autobahn atenv/bin/wstest

What is tested is the LiveSocket that uvicorn starts for viewers; here it returns each message instead of
passing it on. Exit 1 when more fail than ALLOWED.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import uvicorn
from posecast_relay.auth.access import Access
from posecast_relay.core import messages
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.sse import make_http_protocol
from posecast_relay.net.websocket import LiveSocket
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut
from posecast_testing import free_port
from posecast_wire import Close
from websockets.frames import Frame, Opcode
from websockets.http11 import Request

# 7.1.5: a fragment, a close, a fragment. The library answers 1002 where 1000 is wanted.
ALLOWED = {"7.1.5"}
LONGEST = 1 << 25


class Echo(LiveSocket):
    """Returns what it is sent."""

    _kind = Opcode.TEXT

    def _handshake(self, request: Request) -> None:
        self._ws.send_response(self._ws.accept(request))

    def _frame(self, frame: Frame) -> None:
        if frame.opcode in (Opcode.TEXT, Opcode.BINARY):
            self._kind = frame.opcode
        super()._frame(replace(frame, opcode=Opcode.TEXT) if frame.opcode is Opcode.BINARY else frame)

    def _text(self, text: bytes) -> None:
        if self._kind is Opcode.TEXT:
            try:
                text.decode()
            except UnicodeDecodeError:
                self._ws.fail(Close.NOT_UTF8)
                self._send_own()
                return
        self.write(messages.pack_message(self._kind, text))
        self._kind = Opcode.TEXT  # short ones come without `_frame`


@asynccontextmanager
async def echo() -> AsyncIterator[int]:
    """A server that returns everything; its port."""
    access = Access(Dispatcher(Hub(Limits(message_bytes=LONGEST)), MemoryStore(), FanOut(None)))
    Echo.access = access
    port = free_port()
    config = uvicorn.Config(
        lambda _scope, _receive, _send: None,
        ws=Echo,
        http=make_http_protocol(access, DecodeCache()),
        lifespan="off",
        log_config=None,
        port=port,
    )
    server = uvicorn.Server(config)
    serving = asyncio.create_task(server.serve())
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield port
    finally:
        server.should_exit = True
        await serving


async def main(wstest: str, *cases: str) -> int:
    """All cases, or those named (`1.*`)."""
    with tempfile.TemporaryDirectory() as folder:
        async with echo() as port:
            asked = {
                "outdir": folder,
                "servers": [{"agent": "relay", "url": f"ws://127.0.0.1:{port}/"}],
                "cases": cases or ["*"],
                "exclude-cases": [],
                "exclude-agent-cases": {},
            }
            (Path(folder) / "fuzz.json").write_text(json.dumps(asked))
            command = [wstest, "-m", "fuzzingclient", "-s", f"{folder}/fuzz.json"]
            await asyncio.to_thread(subprocess.run, command, check=True, stdout=subprocess.DEVNULL)
        found = json.loads((Path(folder) / "index.json").read_text())["relay"]
    print(Counter(case["behavior"] for case in found.values()))
    for name, case in found.items():
        if case["behavior"] not in ("OK", "INFORMATIONAL", "UNIMPLEMENTED"):
            print(name, case["behavior"], case["behaviorClose"])
    failed = {name for name, case in found.items() if case["behavior"] == "FAILED"}
    return 1 if failed - ALLOWED else 0


if __name__ == "__main__":
    sys.exit(asyncio.run(main(*sys.argv[1:])))
