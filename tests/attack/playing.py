"""One attack, with an innocent robot and viewer, and newcomers in its middle: one row of figures."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Sequence
from contextlib import suppress

from posecast_loadtests.connection import Connection, ProtocolError
from posecast_testing import Process, until
from websockets.frames import Opcode

from tests.attack.arena import Arena, arena, said
from tests.attack.innocent_robot import HZ
from tests.attack.redis_stage import RedisStage
from tests.attack.resource_use import ResourceUse
from tests.attack.row import Row, held_up_s, longest_gap_s, shares
from tests.attack.target import Attack

AFTER_S = 0.4  # what an attack leaves behind is still its own
READY_S = 15.0
ENDS_S = 1.0  # an attacker, after its time
LOOKED_S = 5.0  # a newcomer is waited for so long


class Newcomer(threading.Thread):
    """A robot that connects during the attack, and a viewer that wants to see it."""

    def __init__(self, made: Arena, http: str, zenoh: str) -> None:
        super().__init__(daemon=True)
        self._arena, self._http, self._zenoh = made, http, zenoh
        self.seconds = LOOKED_S

    def run(self) -> None:
        """Seconds from both being started to the first frame."""
        robot = self._arena.robot(self._zenoh, "newcomer")
        with suppress(AssertionError, OSError):  # it may not get in, and all may end meanwhile
            until("the newcomer sends", lambda: "sent" in robot.out, LOOKED_S)
        began_s = time.monotonic()
        while time.monotonic() - began_s < LOOKED_S:
            with suppress(OSError, ProtocolError):
                link = Connection(f"ws://{self._http}/api/v1/robots/newcomer/live?hz=60")
                link.socket.settimeout(LOOKED_S)
                came = next((at for opcode, _, at in link.messages() if opcode is Opcode.BINARY), None)
                link.close()
                if came is not None:
                    self.seconds = came - began_s
                    return
            time.sleep(0.02)


def _last_line(part: Process) -> str:
    lines = [line for line in part.log.splitlines() if line and not line.startswith("---")]
    return lines[-1] if lines else "it said nothing"


def served(made: Arena, attack: Attack | None) -> tuple[list[Process], str, str]:
    """The relays, HOST:PORT of HTTP, of Zenoh."""
    if attack is not None and attack.behind_redis:
        stage = RedisStage(made)
        return [stage.ingest, stage.gateway], stage.http, stage.zenoh
    relay, http, zenoh = made.relay()
    return [relay], http, zenoh


def played(attack: Attack | None, seconds: float, relay_command: Sequence[str]) -> Row:
    """One attack on its own relay; None: no attack."""
    with arena(tuple(relay_command), attack is not None and attack.guarded) as made:
        relays, http, zenoh = served(made, attack)
        robot = made.robot(zenoh)
        screen = made.screen(http)
        attacker = None
        if attack is not None:
            attacker = made.module(
                "attacker", attack.name, http, zenoh, f"{seconds:g}", *made.secret("rude"), nice=True
            )
            attacker.line("READY")
        until("the viewer sees the robot", lambda: len(said(screen, "seq")) > 5, READY_S)
        processes = [ResourceUse(relay.process.pid) for relay in relays]
        logged = [len(relay.log) for relay in relays]
        began_s = time.monotonic()
        if attacker is not None and attacker.process.stdin is not None:
            attacker.process.stdin.write(b"go\n")
            attacker.process.stdin.flush()
        newcomer = Newcomer(made, http, zenoh)
        time.sleep(seconds * 0.4)
        newcomer.start()
        time.sleep(max(0.0, began_s + seconds + AFTER_S - time.monotonic()))
        ended_s = time.monotonic()
        newcomer.join(max(0.0, LOOKED_S - (ended_s - began_s - seconds * 0.4)))
        if attacker is not None:
            with suppress(subprocess.TimeoutExpired):
                attacker.process.wait(ENDS_S)
        log = "".join(relay.log[before:] for relay, before in zip(relays, logged, strict=True))
        did = said(attacker, "did") if attacker is not None else []
        sent = [(line["sent"], line["at"]) for line in said(robot, "sent")]
        came = [(line["seq"], line["at"]) for line in said(screen, "seq")]
        words = [line for line in said(screen, "word") if began_s <= line["at"] and line["word"] != "LIVE"]
        closed = [line for line in said(screen, "closed") if began_s <= line["at"]]
        return Row(
            attack.name if attack else "nobody",
            attack.what if attack else "no attack",
            did[0]["did"] if did else "–",
            shares(sent, came, began_s, ended_s),
            longest_gap_s([at for _, at in came], began_s, ended_s),
            newcomer.seconds,
            max(process.growth_mb() for process in processes),
            log.count("\n") / (ended_s - began_s),
            log.count("Traceback"),
            tuple(dict.fromkeys([str(w["word"]) for w in words] + [f"closed {c['closed']}" for c in closed])),
            held_up_s([at for _, at in sent], 1 / HZ, began_s, ended_s),
            max(process.waited_s() for process in processes),
            any(relay.process.poll() is not None for relay in relays),
            _last_line(attacker) if attacker is not None and not did else "",
        )
