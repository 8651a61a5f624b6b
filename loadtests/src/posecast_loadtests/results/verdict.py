"""The counts of all processes of one test, and the verdict on them when it has ended.

Locust's own reports come every few seconds, and its master waits half a second for the last ones: on a busy
machine counts were lost, and with them whole workers. So the master asks each worker for its counts, and
waits.
"""

from __future__ import annotations

import json
import time
from argparse import ArgumentParser
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import gevent
from locust import events
from locust.env import Environment
from locust.runners import (
    STATE_MISSING,
    STATE_RUNNING,
    STATE_SPAWNING,
    MasterRunner,
    Runner,
    WorkerRunner,
)

from posecast_loadtests.results.tally import LoadLimits, Tally, breaches, report

END, COUNTS = "posecast-end", "posecast-counts"  # messages: to a worker, and what it answers
END_S = 30.0  # a worker has so long to end its users and answer
LOOK_S = 0.05
_UNDER_WAY = (STATE_SPAWNING, STATE_RUNNING)

tally = Tally()  # of this process


class WorkerCounts:
    """At the master: what each worker of this test has counted, so far and at its end."""

    def __init__(self, workers: Iterable[str] = ()) -> None:
        """`workers`: those that were there when the test began. Others may join it later."""
        self._workers = set(workers)
        self._so_far: dict[str, dict[str, Any]] = {}
        self._at_end: dict[str, dict[str, Any]] = {}

    def record(self, worker: str, counts: dict[str, Any], at_end: bool) -> None:
        """Note what a worker has counted since the test began; `at_end`, when its users have ended."""
        self._workers.add(worker)
        (self._at_end if at_end else self._so_far)[worker] = counts

    def find_missing(self) -> set[str]:
        """Return the workers whose end is not known."""
        return self._workers - self._at_end.keys()

    def sum(self) -> Tally:
        """Return all counts; of a worker that was lost, its last report."""
        whole = Tally.sum((self._so_far | self._at_end).values())
        whole.workers_lost = len(self.find_missing())
        return whole


_counts = WorkerCounts()


def _collect(runner: MasterRunner) -> Tally:
    """Ask each worker to end, and wait until all have told their counts, but for those that are lost."""
    for client in runner.clients.all:
        runner.send_message(END, client_id=client.id)
    give_up_s = time.monotonic() + END_S
    while time.monotonic() < give_up_s:
        there = {client.id for client in runner.clients.all if client.state != STATE_MISSING}
        if not _counts.find_missing() & there:
            break
        gevent.sleep(LOOK_S)
    return _counts.sum()


def _add_arguments(parser: ArgumentParser) -> None:
    limits = LoadLimits()
    parser.add_argument("--max-missed", type=float, default=limits.missed_share, help="share of frames")
    parser.add_argument(
        "--max-p99-ms", type=float, default=limits.p99_ms, help="lateness of 99 %% of the frames"
    )
    parser.add_argument("--min-jain", type=float, default=limits.jain, help="fairness of the viewers' rates")
    parser.add_argument("--counts", default="", help="file for the counts, as JSON; then no verdict is given")


def _prepare(runner: Runner | None, **_: Any) -> None:
    def end(environment: Environment, **_: Any) -> None:
        assert environment.runner is not None
        environment.runner.stop()  # `_finish` then tells the counts; a second time is nothing

    def take(msg: Any, **_: Any) -> None:
        _counts.record(msg.node_id, msg.data, at_end=True)

    if isinstance(runner, WorkerRunner):
        runner.register_message(END, end)
    elif isinstance(runner, MasterRunner):
        runner.register_message(COUNTS, take)


def _begin(environment: Environment, **_: Any) -> None:
    global _counts  # noqa: PLW0603 — Locust's hooks are functions
    tally.clear()
    if isinstance(environment.runner, MasterRunner):
        _counts = WorkerCounts(client.id for client in environment.runner.clients.all)


def _tell(data: dict[str, Any], **_: Any) -> None:
    data["posecast"] = tally.counts()


def _hear(client_id: str, data: dict[str, Any], **_: Any) -> None:
    _counts.record(client_id, data["posecast"], at_end=False)


def _finish(environment: Environment, **_: Any) -> None:
    """A test has ended: with Locust's web page there may be another one."""
    runner, options = environment.runner, environment.parsed_options
    assert options is not None
    if isinstance(runner, WorkerRunner):
        runner.send_message(COUNTS, tally.counts())
        return
    whole = _collect(runner) if isinstance(runner, MasterRunner) else tally
    if options.counts:
        with suppress(OSError):
            Path(options.counts).write_text(json.dumps(whole.counts()))
        environment.process_exit_code = 0
        return
    limits = LoadLimits(options.max_missed, options.max_p99_ms, options.min_jain)
    print(report(whole, limits), flush=True)
    environment.process_exit_code = 1 if breaches(whole, limits) else 0


def _quit(environment: Environment, **_: Any) -> None:
    """Ctrl-C and SIGTERM in the middle of a test: what was seen counts."""
    runner = environment.runner
    if not isinstance(runner, WorkerRunner) and runner is not None and runner.state in _UNDER_WAY:
        runner.stop()


# Locust's hooks carry no types; told once, here
_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_add_arguments)
_hooks.init.add_listener(_prepare)
_hooks.test_start.add_listener(_begin)
_hooks.report_to_master.add_listener(_tell)
_hooks.worker_report.add_listener(_hear)
_hooks.test_stop.add_listener(_finish)
_hooks.quitting.add_listener(_quit)
