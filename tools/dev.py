"""`make dev`: the demo, and its page served by Vite, which reloads as you edit and prints the link."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from posecast_command.ports import PAGE_PORT, find_free_port
from posecast_command.processes import Processes, name_program

ROOT = Path(__file__).resolve().parent.parent
VITE = ROOT / "node_modules" / ".bin" / "vite"  # not by npx, which leaves it running when it is ended itself


def main() -> int:
    """Run both until one ends, which is status 1, or Ctrl-C ends them."""
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
