"""Answers queries about the model one at a time in a separate thread, so that many queries or a slow uplink
delay neither Zenoh's threads nor the frames."""

from __future__ import annotations

import threading
import time
from collections import deque

import zenoh
from posecast_wire.keys import model_key

from posecast_edge.kit import ExceptionLog, TokenBucket, make_visible
from posecast_edge.model.serve.bundle import RANGE_MAX, Bundle
from posecast_edge.uplink.session import Run

WAITING_MAX = 64  # questions; a relay asks for a few at a time
BYTES_S = 16e6  # the rate for repeated requests;
BYTES_AT_ONCE = 64e6  # a whole model up to this size is sent at full speed


class ModelServer:
    """Answers the model queries of one robot. `bundle`: the model it has now."""

    def __init__(self, robot: str, run: Run, exceptions: ExceptionLog) -> None:
        self.bundle: Bundle | None = None
        self._robot, self._run, self._exceptions = robot, run, exceptions
        self._waiting: deque[zenoh.Query] = deque()
        self._bucket = TokenBucket(BYTES_S, BYTES_AT_ONCE)
        self._some = threading.Condition()
        self._begun = self._closed = False

    def close(self) -> None:
        """Stop answering. May be called from any thread; returns at once."""
        with self._some:
            self._closed = True
            self._some.notify()

    def enqueue_query(self, query: zenoh.Query) -> None:
        """Queue a query, or refuse it when WAITING_MAX are waiting already. Called by Zenoh's threads;
        returns at once."""
        with self._some:
            if not self._begun:
                self._begun = True
                threading.Thread(target=self._answer_all, name="model", daemon=True).start()
            if len(self._waiting) < WAITING_MAX:
                self._waiting.append(query)
                self._some.notify()
                return
        with query:
            query.reply_err(b"too many questions at a time")

    def _answer_all(self) -> None:
        while True:
            with self._some:
                self._some.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                wait_s = self._bucket.compute_wait_s(time.monotonic(), RANGE_MAX)
                if wait_s > 0:
                    self._some.wait_for(lambda: self._closed, wait_s)
                    continue
                query = self._waiting.popleft()
            try:
                self._answer(query)
            except Exception as e:
                self._exceptions.add("answering a query about the model", e)

    def _answer(self, query: zenoh.Query) -> None:
        part = str(query.key_expr).rpartition("/")[2]
        with query:
            try:
                data = self._range(part, query.parameters)
            except (KeyError, ValueError, OSError) as e:
                query.reply_err(make_visible(f"{part[:64]}: {e}", 200).encode())
                return
            self._bucket.take(time.monotonic(), len(data))
            query.reply(model_key(self._robot, part), data, attachment=self._run.make_stamp().pack())

    def _range(self, part: str, parameters: zenoh.Parameters) -> bytes:
        """The requested bytes. Raises KeyError, ValueError or OSError when there is no such file or range."""
        if self.bundle is None:
            raise KeyError("no model")
        offset = int(parameters.get("off") or 0)
        length = int(parameters.get("len") or RANGE_MAX)
        return self.bundle.read(part, offset, length)
