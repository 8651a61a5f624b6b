"""One of firebase-tools' emulators, Google's own, as a process on free ports."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import time
from pathlib import Path
from typing import Any

import httpx

ROOT = Path(__file__).parents[2]
TOOLS = ROOT / "out/firebase-tools"
PROJECT = "demo-posecast"  # `demo-`: nothing of Google's is asked
START_S = 180.0
NOWHERE = "http://127.0.0.1:9"


class NotHere(RuntimeError):
    """Why the emulator is unavailable."""


class Emulator:
    """Serves on `host`, an address with its port. NotHere if it can't be installed."""

    def __init__(self, folder: Path, kind: str, settings: dict[str, Any] | None = None) -> None:
        """`settings`: the rest of firebase.json, which is laid into `folder`."""
        self._kind = kind
        try:
            subprocess.run([ROOT / "tests/firebase/install"], check=True, capture_output=True, timeout=600)
        except (subprocess.SubprocessError, OSError) as e:
            said = getattr(e, "stderr", None) or b""
            raise NotHere(f"firebase-tools can't be installed: {said.decode()[-200:] or e}") from None
        ports = _free_ports(3)
        emulators = {
            name: {"host": "127.0.0.1", "port": port}
            for name, port in zip((kind, "hub", "logging"), ports, strict=True)
        }
        config = folder / "firebase.json"
        both = {**(settings or {}), "emulators": {**emulators, "ui": {"enabled": False}}}
        config.write_text(json.dumps(both))
        self.host = f"127.0.0.1:{ports[0]}"
        self._log = folder / "emulator.log"
        # it waits half a minute for Google's news before it begins, unless the way there is closed
        closed = {f"{scheme}_proxy": NOWHERE for scheme in ("http", "https")}
        closed |= {name.upper(): value for name, value in closed.items()} | {"NO_PROXY": "127.0.0.1"}
        closed |= {"no_proxy": "127.0.0.1", "CI": "1"}
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [
                    *(TOOLS / "node_modules/.bin/firebase", "emulators:start", "--only", kind),
                    *("--project", PROJECT, "--config", config),
                ],
                cwd=folder,
                env=os.environ | closed,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        end_s = time.monotonic() + START_S
        while not self._answers():
            if self.process.poll() is not None or time.monotonic() > end_s:
                self.stop()
                raise NotHere(f"the emulator of {kind} does not start: {self._log.read_text()[-400:]}")
            time.sleep(0.1)

    def _answers(self) -> bool:
        try:
            answer = httpx.get(f"http://{self.host}/", trust_env=False, timeout=2)
        except httpx.HTTPError:
            return False
        return bool(answer.status_code == 200)

    def stop(self) -> None:
        """Stop it and the processes it has started."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            if self.process.poll() is None:
                os.killpg(self.process.pid, number)
                try:
                    self.process.wait(15)
                except subprocess.TimeoutExpired:
                    continue


def _free_ports(count: int) -> list[int]:
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [int(probe.getsockname()[1]) for probe in probes]
    for probe in probes:
        probe.close()
    return ports
