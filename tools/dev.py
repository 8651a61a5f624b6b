"""`make dev`: the demo, with its page served by Vite, which reloads as you edit and prints the link."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from posecast_command.local_relay import PAGE_PORT, find_free_port
from posecast_command.processes import Processes, name_program

ROOT = Path(__file__).resolve().parent.parent
VITE = ROOT / "node_modules" / ".bin" / "vite"  # not npx: Vite would keep running after npx is stopped


def main() -> int:
    """Run both until one ends (returns 1), or until Ctrl-C."""
    port = find_free_port("127.0.0.1", PAGE_PORT)
    environment = {**os.environ, "POSECAST_RELAY": f"http://127.0.0.1:{port}"}
    try:
        with Processes() as processes:
            processes.start(name_program("demo", "--no-browser", "--port", str(port)))
            processes.start([str(VITE), "--port", "5173"], environment=environment, folder=ROOT / "spa")
            while processes.find_ended() is None:
                processes.pause()
            return 1
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
