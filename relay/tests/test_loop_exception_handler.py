"""Failures that nobody waits for."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import ssl

import pytest
from posecast_relay.logging import JsonLines, LoopExceptionHandler


async def test_a_connection_given_up_is_one_line_and_a_mistake_of_ours_is_named(
    caplog: pytest.LogCaptureFixture,
) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(LoopExceptionHandler())
    caplog.set_level(logging.WARNING)
    for error in (ssl.SSLError(1, "CERTIFICATE_VERIFY_FAILED"),) * 3 + (ConnectionResetError("gone"),):
        loop.create_future().set_exception(error)  # nobody holds it
    said = [(record.getMessage(), record.exc_info) for record in caplog.records]
    assert [text.partition(": ")[0] for text, _ in said] == ["a connection timed out"] * 2
    assert "CERTIFICATE_VERIFY_FAILED" in said[0][0]
    assert not any(exc_info for _, exc_info in said)
    loop.create_future().set_exception(KeyError("ours"))
    assert re.fullmatch(r"Future exception was never retrieved: KeyError: 'ours'", shown(caplog.records[-1]))


def shown(record: logging.LogRecord) -> str:
    """The line as it is written."""
    return str(json.loads(JsonLines().format(record))["event"])


class Transport:
    """As the loop names it when something fails."""

    def __init__(self, closed: bool) -> None:
        self.is_closing = lambda: closed


async def test_what_still_comes_over_a_closed_transport_is_one_line(caplog: pytest.LogCaptureFixture) -> None:
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(LoopExceptionHandler())
    late = RuntimeError("unable to perform operation on <TCPTransport closed=True>; the handler is closed")
    for closed in (True, True, False):
        said = {"message": "Fatal error on SSL protocol", "exception": late, "transport": Transport(closed)}
        loop.call_exception_handler(said)
    assert [bool(record.exc_info) for record in caplog.records] == [False, True]
