"""`python -m posecast_loadtests [SCENARIO …]`: runs each scenario on its own relay, with a control viewer.

`make load` runs it. With `-H ws://host:port --zenoh tcp/host:port` it starts nothing and loads that relay
instead. Results go to `--out`: Locust's HTML report and CSV files, and the counts as JSON. Exit status 1 if a
limit was exceeded.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

from posecast_loadtests.results import Tally, breaches, report
from posecast_loadtests.scenarios import SCENARIOS, Scenario
from posecast_loadtests.stage import Address, ends_on_term, own_relay, started

SOURCE_HZ = 30


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m posecast_loadtests", description="Load tests of the relay."
    )
    parser.add_argument("scenario", nargs="*", help=f"of {', '.join(SCENARIOS)}; all if none is named")
    parser.add_argument("-H", "--host", help="a running relay, ws://host:port, with the robot `demo`")
    parser.add_argument("--zenoh", default="tcp/127.0.0.1:7447", help="where the relay's robots connect")
    parser.add_argument("--viewers", type=int, help="number of viewers, instead of the scenario's")
    parser.add_argument("--stretch", type=float, default=1.0, help="factor for all times")
    parser.add_argument(
        "--processes", type=int, help="Locust workers; each can run about 1,000 viewers at 10 Hz"
    )
    parser.add_argument("--out", type=Path, default=Path("out/load"))
    asked = parser.parse_args()
    for name in asked.scenario:
        if name not in SCENARIOS:
            parser.error(f"no scenario {name!r}: use {', '.join(SCENARIOS)}")
    if asked.stretch <= 0 or (asked.viewers is not None and asked.viewers < 1):
        parser.error("--stretch and --viewers must be above 0")
    return asked


def run(scenario: Scenario, asked: argparse.Namespace) -> tuple[Tally, Tally]:
    """Run a scenario. Return the counts of Locust's viewers and of the control viewer."""
    at = str(asked.out / scenario.name)
    logs = Path(at)
    with ExitStack() as stack:
        address = Address(asked.host, asked.zenoh) if asked.host else own_relay(stack, logs).address
        stream = f"{address.viewers}/api/v1/robots/demo/live?hz={scenario.hz:g}"
        watch = ("-m", "posecast_loadtests.control", stream, str(round(SOURCE_HZ / scenario.hz)))
        control = started(stack, logs, "control", sys.executable, *watch, stdin=subprocess.PIPE)
        counts = Path(f"{at}.json")
        counts.unlink(missing_ok=True)
        command = [
            *(sys.executable, "-m", "locust", "-f", str(Path(__file__).with_name("scenario_file.py"))),
            *("--headless", "--only-summary", "--loglevel", "WARNING", "--scenario", scenario.name),
            *("-H", address.viewers, "--zenoh", address.robots, "--stretch", str(asked.stretch)),
            *("--viewers", str(asked.viewers or scenario.viewers), "--counts", str(counts)),
            *("--html", f"{at}.html", "--csv", at),
            *(("--processes", str(asked.processes)) if asked.processes else ()),
        ]
        status = started(stack, logs, "locust", *command).process.wait()
        if status or not counts.exists():
            sys.exit(f"{scenario.name}: Locust exited with status {status}, see {logs}")
        control.process.communicate()
        told = json.loads(control.out)
    return Tally.sum([json.loads(counts.read_text())]), Tally.sum([told])


def main() -> int:
    asked = options()
    ends_on_term()
    asked.out.mkdir(parents=True, exist_ok=True)
    broken = 0
    for name in asked.scenario or SCENARIOS:
        scenario = SCENARIOS[name].stretched(asked.stretch, asked.viewers)
        print(
            f"\n{scenario.name}: {scenario.title}\n{scenario.viewers} viewers × {scenario.hz:g} Hz",
            flush=True,
        )
        viewers, control = run(scenario, asked)
        print(report(viewers, scenario.limits, control), flush=True)
        found = breaches(viewers, scenario.limits, control)
        broken += bool(found)
        result = {"viewers": viewers.counts(), "control": control.counts(), "breaches": found}
        (asked.out / f"{name}.json").write_text(json.dumps(result, indent=1))
    print(f"\nreports: {asked.out}/*.html")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
