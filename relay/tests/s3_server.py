"""A real S3 server for tests, and a proxy before it that can be slow or closed. Both end with the test."""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from posecast_testing import free_port, is_listened_on, until

GATEWAY = "github.com/versity/versitygw/cmd/versitygw@v1.8.0"  # Apache-2.0; its Go module, as go.sum has it
ACCESS, SECRET, BUCKET = "testuser", "testsecret", "past"


def find_versitygw() -> str:
    """Return where the server's program is, built from its module if need be; skips without Go."""
    found = shutil.which("versitygw") or shutil.which("versitygw", path=os.path.expanduser("~/go/bin"))
    if found is not None:
        return found
    if shutil.which("go") is None:
        pytest.skip("neither versitygw nor go here: apt-get install golang")
    subprocess.run(["go", "install", GATEWAY], check=True, timeout=900)
    path = subprocess.check_output(["go", "env", "GOBIN", "GOPATH"], text=True).splitlines()
    return f"{path[0] or path[1] + '/bin'}/versitygw"


class S3Server:
    """versitygw over a folder, at `port`; a bucket is a folder in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / BUCKET).mkdir(parents=True, exist_ok=True)
        self.port = free_port()
        self._program = find_versitygw()
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, *flags: str, secret: str = SECRET) -> None:
        """Until it takes connections."""
        keys = {"ROOT_ACCESS_KEY": ACCESS, "ROOT_SECRET_KEY": secret}
        self.process = subprocess.Popen(
            [self._program, "--port", f"127.0.0.1:{self.port}", *flags, "posix", str(self.folder)],
            env=os.environ | keys,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        until("the S3 server answers", lambda: is_listened_on(self.port), 30.0)

    def kill(self) -> None:
        """At once."""
        if self.process is not None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()
            self.process = None

    def restart(self) -> None:
        """As it should be."""
        self.kill()
        self.start()


class Proxy:
    """Passes connections on to a port from a thread of its own; `put_s` delays each PUT, `close` cuts all."""

    def __init__(self, to_port: int) -> None:
        self.port = free_port()
        self.put_s = 0.0
        self.requests = 0
        self.puts = 0
        self._to_port = to_port
        self._is_open = True
        self._writers: set[asyncio.StreamWriter] = set()
        self._loop = asyncio.new_event_loop()
        self._server: asyncio.Server | None = None
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._run(self._listen())

    def _run(self, what: object) -> None:
        asyncio.run_coroutine_threadsafe(what, self._loop).result(10)  # type: ignore[arg-type]

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            there, back = await asyncio.open_connection("127.0.0.1", self._to_port)
        except OSError:
            writer.close()
            return
        self._writers |= {writer, back}
        tasks = [
            asyncio.create_task(self._pass(reader, back, self._look_at)),
            asyncio.create_task(self._pass(there, writer, self._let_by)),
        ]
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            task.cancel()
        for each in (writer, back):
            self._writers.discard(each)
            each.close()

    async def _look_at(self, data: bytes) -> None:
        method = data.split(b" ", 1)[0]
        if method in (b"PUT", b"GET", b"HEAD", b"DELETE", b"POST"):
            self.requests += 1
        if method == b"PUT":
            self.puts += 1
            await asyncio.sleep(self.put_s)

    async def _let_by(self, _data: bytes) -> None:
        return

    async def _pass(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, look: Callable[..., object]
    ) -> None:
        with contextlib.suppress(OSError):
            while data := await reader.read(1 << 16):
                await look(data)  # type: ignore[misc]
                writer.write(data)
                await writer.drain()

    def close(self) -> None:
        """Cut all connections, and take no more."""

        async def cut() -> None:
            assert self._server is not None
            self._server.close()
            for writer in tuple(self._writers):
                writer.transport.abort()

        self._run(cut())

    def open(self) -> None:
        """Take connections again."""
        self._run(self._listen())

    def stop(self) -> None:
        """End it."""
        with contextlib.suppress(Exception):
            self.close()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)


@pytest.fixture
def s3(tmp_path: Path) -> Iterator[S3Server]:
    """A running S3 server with an empty bucket."""
    server = S3Server(tmp_path / "s3")
    server.start()
    yield server
    server.kill()


@pytest.fixture
def proxy(s3: S3Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[Proxy]:
    """A proxy before it, and the environment that leads there."""
    found = Proxy(s3.port)
    for name, value in make_environ(found.port).items():
        monkeypatch.setenv(name, value)
    yield found
    found.stop()


def make_environ(port: int) -> dict[str, str]:
    """The variables that lead to an S3 server of one's own."""
    return {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": ACCESS,
        "AWS_SECRET_ACCESS_KEY": SECRET,
        "AWS_REGION": "us-east-1",
    }
