"""Network namespaces made by a test and removed with it; skipped if root or iproute2 is missing."""

from __future__ import annotations

import ctypes
import os
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import pytest

T = TypeVar("T")

CLONE_NEWNET = 0x40000000
NEAR, FAR = "10.9.0.1", "10.9.0.2"


class Namespace:
    """A network namespace: a thread in it, and the processes that this thread starts."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1)
        error = self.run(self._leave)
        if error:
            pytest.skip(f"no network namespace: {os.strerror(error)}; root is needed")
        self.path = f"/proc/{os.getpid()}/task/{self.run(threading.get_native_id)}/ns/net"

    @staticmethod
    def _leave() -> int:
        return 0 if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET) == 0 else ctypes.get_errno()

    def submit(self, work: Callable[[], T]) -> Future[T]:
        """Runs in it, in turn."""
        return self._pool.submit(work)

    def run(self, work: Callable[[], T]) -> T:
        """The same, waited for."""
        return self.submit(work).result()

    def do(self, *commands: str) -> None:
        """Runs network tools, all of which must succeed."""
        for command in commands:
            self.run(lambda c=command: subprocess.run(c.split(), check=True))  # type: ignore[misc]

    def close(self) -> None:
        """Removed as soon as its processes have ended."""
        self._pool.shutdown()


class Cable:
    """Two namespaces with a cable between them: NEAR on interface `cable`, FAR on `plug`."""

    def __init__(self) -> None:
        self.near, self.far = Namespace(), Namespace()
        try:
            self.near.do(
                "ip link set lo up",
                "ip link add cable type veth peer name plug",
                f"ip link set plug netns {self.far.path}",
                f"ip address add {NEAR}/24 dev cable",
                "ip link set cable up",
            )
            self.far.do("ip link set lo up", f"ip address add {FAR}/24 dev plug", "ip link set plug up")
        except FileNotFoundError as e:
            pytest.skip(f"{e.filename} is needed (iproute2)")

    def lend(self, loopback: str) -> None:
        """Lets FAR reach what listens on this address of NEAR's loopback."""
        self.near.do("sysctl -qw net.ipv4.conf.cable.route_localnet=1")
        self.far.do(
            "sysctl -qw net.ipv4.conf.plug.route_localnet=1", f"ip route add {loopback}/32 dev plug src {FAR}"
        )

    def close(self) -> None:
        """Unplugged."""
        for namespace in (self.near, self.far):
            namespace.close()
