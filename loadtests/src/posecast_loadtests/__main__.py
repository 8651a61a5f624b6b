"""`python -m posecast_loadtests`: a relay and a demo robot of its own, and Locust's viewers on them.

Arguments are Locust's (`-u`, `-r`, `-t`, `--hz`, …) and stand after the defaults below, so they win. With
`-H ws://…` nothing is started and that relay is loaded instead.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
import urllib.request
from contextlib import ExitStack, suppress
from pathlib import Path

DEFAULTS = ["--headless", "--only-summary", "-u", "200", "-r", "50", "-t", "30s"]
_SERVING = re.compile(r"serving http://(\S+), robots on (\S+)")
_GRACE_S = 10.0
_START_LIMIT_S = 60.0


def started(stack: ExitStack, *command: str) -> subprocess.Popen[str]:
    """A process that ends with `stack`; its stdout is piped."""
    process = subprocess.Popen([*command], stdout=subprocess.PIPE, text=True)

    def end() -> None:
        process.terminate()
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    stack.callback(end)
    return process


def own_relay(stack: ExitStack) -> str:
    """Starts a relay and the demo robot; the address for `-H`."""
    here = Path(sys.executable).parent
    relay = started(
        stack, f"{here}/posecast-relay", "run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"
    )
    assert relay.stdout is not None
    line = relay.stdout.readline()
    found = _SERVING.search(line)
    if found is None:
        sys.exit(f"the relay didn't start: {line.strip() or 'see above'}")
    started(stack, f"{here}/posecast-edge", "run", "--robot", "demo", "--source", "demo", "--relay", found[2])
    wait_on_air(f"http://{found[1]}/api/v1/robots/demo/state")
    return f"ws://{found[1]}"


def wait_on_air(state: str) -> None:
    """Until the robot's state can be read: load on an absent robot would measure nothing."""
    end_s = time.monotonic() + _START_LIMIT_S
    while time.monotonic() < end_s:
        with suppress(OSError), urllib.request.urlopen(state, timeout=2):
            return
        time.sleep(0.1)
    sys.exit(f"no robot on air within {_START_LIMIT_S:.0f} s")


def main(arguments: list[str]) -> int:
    """Locust's exit code: 1 when a limit didn't hold."""
    with ExitStack() as stack:
        target = [] if "-H" in arguments or "--host" in arguments else ["-H", own_relay(stack)]
        locustfile = [sys.executable, "-m", "locust", "-f", str(Path(__file__).with_name("user.py"))]
        return subprocess.run([*locustfile, *DEFAULTS, *target, *arguments], check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
