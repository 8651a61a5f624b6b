"""A real Redis Cluster for tests: its nodes can be killed. Ended by their processes."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import redis
from posecast_testing import free_port, until

SLOTS = 16384


class Node:
    """One server of a cluster."""

    def __init__(self, folder: Path) -> None:
        self.port, bus = free_port(), free_port()
        folder.mkdir()
        command = ["redis-server", "--port", str(self.port), "--bind", "127.0.0.1", "--save", ""]
        command += ["--dir", str(folder), "--cluster-enabled", "yes", "--cluster-port", str(bus)]
        command += ["--cluster-node-timeout", "2000"]
        self._address = ("127.0.0.1", self.port, bus)
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        until("a node answers", self._answers)

    def ask(self, *words: object) -> Any:
        """Its answer."""
        client: Any = redis.Redis(port=self.port, socket_timeout=5)
        with client:
            return client.execute_command(*words)

    def meet(self, other: Node) -> None:
        """Get to know each other."""
        self.ask("CLUSTER", "MEET", *other._address)

    def _answers(self) -> bool:
        try:
            return bool(self.ask("PING"))
        except redis.ConnectionError:
            return False

    def kill(self) -> None:
        """At once."""
        self.process.kill()
        self.process.wait()


class Cluster:
    """Three masters, and a replica of each if asked for; no data on disk."""

    def __init__(self, folder: Path) -> None:
        self.masters: list[Node] = []
        self.replicas: list[Node] = []
        self._folder = folder

    @property
    def nodes(self) -> list[Node]:
        """All."""
        return self.masters + self.replicas

    @property
    def url(self) -> str:
        """By one of them."""
        return f"redis+cluster://127.0.0.1:{self.masters[-1].port}"

    def start(self, replicas: bool = False) -> None:
        """Until every node knows all."""
        for i in range(3):
            node = Node(self._folder / f"master{i}")
            self.masters.append(node)
            share = range(i * SLOTS // 3, (i + 1) * SLOTS // 3)
            node.ask("CLUSTER", "ADDSLOTSRANGE", share.start, share.stop - 1)
            node.ask("CLUSTER", "SET-CONFIG-EPOCH", i + 1)
        if replicas:
            self.replicas = [Node(self._folder / f"replica{i}") for i in range(3)]
        for node in self.nodes[1:]:
            node.meet(self.masters[0])
        for node in self.nodes:
            until("the cluster is whole", lambda n=node: self._is_whole(n), 30.0)  # type: ignore[misc]
        for master, replica in zip(self.masters, self.replicas, strict=False):
            replica.ask("CLUSTER", "REPLICATE", master.ask("CLUSTER", "MYID").decode())
        for replica in self.replicas:
            until("it follows", lambda n=replica: _follows(n))  # type: ignore[misc]

    def _is_whole(self, node: Node) -> bool:
        state, known = node.ask("CLUSTER", "INFO"), node.ask("CLUSTER", "NODES")
        return b"cluster_state:ok" in state and known.count(b" connected") == len(self.nodes)

    def place(self, robot: str) -> int:
        """Which of the masters has this robot."""
        slot = self.masters[0].ask("CLUSTER", "KEYSLOT", f"posecast:{{{robot}}}:live")
        return int(slot) * 3 // SLOTS

    def robots(self) -> list[str]:
        """A robot for every master, in their order."""
        names: dict[int, str] = {}
        for i in range(100):
            names.setdefault(self.place(f"r{i}"), f"r{i}")
        return [names[i] for i in range(3)]

    def stop(self) -> None:
        """All nodes, by their processes."""
        for node in self.nodes:
            node.kill()


def _follows(replica: Node) -> bool:
    return b"connected" in replica.ask("ROLE")
