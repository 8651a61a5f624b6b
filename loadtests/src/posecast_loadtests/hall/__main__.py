"""`python -m posecast_loadtests.hall`: many viewers, a relay with few places, and the relay is replaced once.

Starts a relay with `--max-viewers 50`, the demo robot and 500 viewers, of which 450 use the lane. Once every
viewer has received something, the relay is stopped and another one starts on its port. The test ends once
every viewer has received something from the new relay. No viewer may be refused. Results go to `--out`. Exit
status 1 if anything failed.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

from posecast_testing import free_port

from posecast_loadtests.hall.hall_counts import HallCounts, Replacement, find_breaches, make_report
from posecast_loadtests.stage import ends_on_term, own_relay, started

JOINED_A_SECOND = 50
LIMIT_S = 120.0
POLL_S = 0.2


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m posecast_loadtests.hall", description=(__doc__ or "").split(": ", 1)[1].split("\n")[0]
    )
    parser.add_argument("--viewers", type=int, default=500)
    parser.add_argument("--places", type=int, default=50, help="the relay's --max-viewers")
    parser.add_argument("--out", type=Path, default=Path("out/load"))
    asked = parser.parse_args()
    if not 0 < asked.places < asked.viewers:
        parser.error("--viewers must be more than --places, and both above 0")
    return asked


def wait_for(file: Path, holds: Callable[[HallCounts], bool]) -> HallCounts:
    """Return the counts once `holds` is true, or the current ones after LIMIT_S."""
    end_s, counts = time.monotonic() + LIMIT_S, HallCounts()
    while time.monotonic() < end_s:
        with suppress(FileNotFoundError):
            counts = HallCounts.read(json.loads(file.read_text()))
            if holds(counts):
                break
        time.sleep(POLL_S)
    return counts


def play(viewers: int, places: int, out: Path) -> tuple[HallCounts, Replacement]:
    """Run the test. Return what the viewers saw, and when there was no relay."""
    out.mkdir(parents=True, exist_ok=True)
    file = out / "hall-counts.json"
    file.unlink(missing_ok=True)
    ports = ["--port", f"{free_port()}", "--zenoh-listen", f"tcp/127.0.0.1:{free_port()}"]
    flags = [*ports, "--max-viewers", f"{places}", "--past", "memory:"]
    with (out / "hall.log").open("w") as log, ExitStack() as stack:
        own = own_relay(stack, log, *flags)
        locust = [sys.executable, "-m", "locust", "-f", str(Path(__file__).with_name("hall_file.py"))]
        locust += ["--headless", "--only-summary", "--loglevel", "WARNING", "-H", own.address.viewers]
        locust += ["-u", f"{viewers}", "-r", f"{JOINED_A_SECOND}", "--counts", str(file)]
        crowd = started(stack, log, *locust)
        wait_for(file, lambda counts: counts.count_served(0.0) >= viewers)
        ends_s = time.monotonic()
        own.relay.send_signal(signal.SIGTERM)
        own.relay.wait(LIMIT_S)
        command = [str(Path(sys.executable).with_name("posecast-relay")), "run", "--dev", *flags]
        relay = started(stack, log, *command)
        assert relay.stdout is not None
        if "serving" not in relay.stdout.readline():
            sys.exit(f"the second relay didn't start, see {log.name}")
        replaced = Replacement(ends_s, time.monotonic())
        wait_for(file, lambda counts: counts.count_served(replaced.serves_s) >= viewers)
        crowd.terminate()
        crowd.wait(LIMIT_S)
        counts = HallCounts.read(json.loads(file.read_text()))
    return counts, replaced


def main() -> int:
    asked = options()
    ends_on_term()
    print(f"a hall: {asked.viewers} viewers, {asked.places} places, the relay is replaced once", flush=True)
    counts, replaced = play(asked.viewers, asked.places, asked.out)
    print(make_report(counts, asked.viewers, asked.places, replaced))
    found = find_breaches(counts, asked.viewers, asked.places, replaced)
    result = {"counts": counts.write(), "no_relay_s": replaced.serves_s - replaced.ends_s, "breaches": found}
    (asked.out / "hall.json").write_text(json.dumps(result, indent=1))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
