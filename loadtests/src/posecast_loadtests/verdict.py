"""The counts of all processes of one test, and the verdict on them at its end.

Locust's reports come only every few seconds, and its master waits just half a second for the last ones. On a
busy machine that loses the counts of whole workers. So the master asks each worker for its counts, and waits.
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

from posecast_loadtests.results import LoadLimits, Tally, breaches, report

END, COUNTS = "posecast-end", "posecast-counts"  # messages: to a worker, and its response
END_S = 30.0  # how long a worker may take to end its users and respond
LOOK_S = 0.05
_UNDER_WAY = (STATE_SPAWNING, STATE_RUNNING)

tally = Tally()  # the counts of this process


class WorkerCounts:
    """The master's record of what each worker has counted, so far and at its end."""

    def __init__(self, workers: Iterable[str] = ()) -> None:
        """`workers`: those present when the test began. More may join later."""
        self._workers = set(workers)
        self._so_far: dict[str, dict[str, Any]] = {}
        self._at_end: dict[str, dict[str, Any]] = {}

    def record(self, worker: str, counts: dict[str, Any], at_end: bool) -> None:
        """Record a worker's counts since the test began. `at_end`: its users have ended."""
        self._workers.add(worker)
        (self._at_end if at_end else self._so_far)[worker] = counts

    def find_missing(self) -> set[str]:
        """Return the workers that have not sent their final counts."""
        return self._workers - self._at_end.keys()

    def sum(self) -> Tally:
        """Return the sum of all counts, using the last report of a lost worker."""
        whole = Tally.sum((self._so_far | self._at_end).values())
        whole.workers_lost = len(self.find_missing())
        return whole


_counts = WorkerCounts()


def _collect(runner: MasterRunner) -> Tally:
    """Ask each worker to end, and wait for the counts of all that are not lost."""
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
    parser.add_argument(
        "--max-missed", type=float, default=limits.missed_share, help="the largest share of missed frames"
    )
    parser.add_argument(
        "--max-p99-ms", type=float, default=limits.p99_ms, help="the largest 99th percentile of lateness"
    )
    parser.add_argument(
        "--min-jain",
        type=float,
        default=limits.jain,
        help="the smallest fairness index of the viewers' rates",
    )
    parser.add_argument(
        "--counts", default="", help="write the counts as JSON to this file, without a verdict"
    )


def _prepare(runner: Runner | None, **_: Any) -> None:
    def end(environment: Environment, **_: Any) -> None:
        assert environment.runner is not None
        environment.runner.stop()  # `_finish` then reports the counts; a second call does nothing

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
    """Report when a test has ended. With Locust's web page another test may follow."""
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
    """Report on Ctrl-C and SIGTERM in the middle of a test: the counts so far are valid."""
    runner = environment.runner
    if not isinstance(runner, WorkerRunner) and runner is not None and runner.state in _UNDER_WAY:
        runner.stop()


# Locust's hooks have no types, so ignore that here, once
_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_add_arguments)
_hooks.init.add_listener(_prepare)
_hooks.test_start.add_listener(_begin)
_hooks.report_to_master.add_listener(_tell)
_hooks.worker_report.add_listener(_hear)
_hooks.test_stop.add_listener(_finish)
_hooks.quitting.add_listener(_quit)
