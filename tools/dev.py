"""`make dev`: the demo, and its page served by Vite, which reloads as you edit and prints the link."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from posecast_command.ports import PAGE_PORT, find_free_port
from posecast_command.processes import Processes, obey_endings

SPA = Path(__file__).resolve().parent.parent / "spa"


def main() -> int:
    """Run both until one ends; the exit status."""
    port = find_free_port("127.0.0.1", PAGE_PORT)
    environment = {**os.environ, "POSECAST_RELAY": f"http://127.0.0.1:{port}"}
    obey_endings()
    try:
        with Processes() as processes:
            processes.start(["demo", "--no-browser", "--port", str(port)])
            vite = ["npx", "--no-install", "vite", "--port", "5173"]
            return subprocess.run(vite, cwd=SPA, env=environment, check=False).returncode
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
