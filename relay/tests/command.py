"""`posecast-relay …` in this process: a process of its own takes longer to start than to do what is asked."""

from __future__ import annotations

import io
import os
import signal
import sys
from contextlib import redirect_stderr, redirect_stdout
from subprocess import CompletedProcess
from typing import NoReturn
from unittest.mock import patch

from posecast_relay import cli


def run_command(*argv: str, stdin: bytes = b"", **environ: str) -> CompletedProcess[str]:
    """Run it to its end. `environ`: more of the environment."""
    out, err, status = io.StringIO(), io.StringIO(), 0

    def end(status: int) -> NoReturn:
        raise SystemExit(status)

    with (
        redirect_stdout(out),
        redirect_stderr(err),
        patch.object(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin))),
        patch.dict(os.environ, environ),
        patch.object(os, "_exit", end),
        patch.object(signal, "signal"),
    ):
        try:
            cli.main(list(argv))
        except SystemExit as e:
            status = int(str(e.code))
    return CompletedProcess(argv, status, out.getvalue(), err.getvalue())
