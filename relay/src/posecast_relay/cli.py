"""`posecast-relay`: reads the settings and runs the relay."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from posecast_relay.config import SettingsError, parse


def main(argv: Sequence[str] | None = None) -> int:
    """Exit status: 0 after SIGTERM or Ctrl-C, 2 for a wrong setting or a port in use."""
    try:
        settings = parse(sys.argv[1:] if argv is None else argv, os.environ)
    except SettingsError as e:
        print(f"posecast-relay: {e}", file=sys.stderr)
        return 2
    try:
        from posecast_relay.serve import StartError, run  # noqa: PLC0415 — --help and a wrong flag answer at once

        try:
            run(settings)
        except StartError as e:
            print(f"posecast-relay: {e}", file=sys.stderr)
            return 2
    except KeyboardInterrupt:  # before the loop has taken the signals over
        return 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
