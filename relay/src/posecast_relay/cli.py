"""`posecast-relay`: reads the settings and runs the relay, or another of its commands."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

from posecast_wire.command_line.terminal import paint

from posecast_relay.config.settings import SettingsError, StartError, parse


def main(argv: Sequence[str] | None = None, program: str = "posecast-relay") -> NoReturn:
    """Entry point. Exits with status 0 after SIGTERM or Ctrl-C, 2 for a wrong setting or a port in use.

    `argv`: the arguments; None: those of the process. `program`: its name in messages.
    """
    status = 0
    try:
        # until the event loop handles signals, nothing needs closing; an import could swallow an exception
        signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
        _run(sys.argv[1:] if argv is None else argv, program)
    except (SettingsError, StartError) as e:
        print(paint(f"{program}:", "red", sys.stderr), e, file=sys.stderr)
        status = 2
    except KeyboardInterrupt:
        pass
    # Everything is closed. A normal interpreter exit would wait for library threads (a DNS server that does
    # not answer), and a Zenoh thread that calls into Python meanwhile would abort the process.
    with suppress(BrokenPipeError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)


def _run(argv: Sequence[str], program: str) -> None:
    if argv[:1] == ["robots"]:
        from posecast_relay.config.robots_command import run_robots  # noqa: PLC0415 — starts sooner

        run_robots(argv[1:], os.environ, program)
        return
    if argv[:1] == ["past"]:
        from posecast_relay.past_command.main import run_past  # noqa: PLC0415 — starts sooner

        run_past(argv[1:], os.environ, program)
        return
    if argv[:1] == ["convert"]:
        from posecast_relay.past_command.convert import run_convert  # noqa: PLC0415 — starts sooner

        run_convert(argv[1:], program)
        return
    settings = parse(argv, os.environ, program)
    from posecast_relay.server.process import run  # noqa: PLC0415 — --help and a wrong flag answer at once

    run(settings)


if __name__ == "__main__":
    main()
