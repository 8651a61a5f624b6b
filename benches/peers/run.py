"""What one would pick instead, beside the relay: the same viewers and frames, in turn (`make peers`).

The server has one core, its robot and the viewers (C) the other. Two scenarios: `steady`, 1,000 viewers of
30 Hz and 200 B, says what a message costs; `slow`, 50 viewers of larger frames of whom 5 stop reading, what
becomes of those and the others. Who is not installed is named with the reason. Writes out/peers/peers.json.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from functools import partial
from pathlib import Path

from benches.peers.peers import NODE_MODULES, OUT, PEERS, RELAY, Options, Peer, serve
from benches.peers.table import print_all
from relay.benches.bench import TRIES, calmest, machine, prepare, progress
from relay.benches.build import NoCompiler
from relay.benches.measure import Row, command, derive, play
from relay.benches.scenarios import Scenario
from relay.benches.servers import CannotStart, Place
from relay.benches.stamps import make_stamps

SCENARIOS = {
    "steady": Scenario("steady", "1,000 viewers × 30 Hz × 200 B", 1000, 30),
    "slow": Scenario(
        "slow", "50 viewers × 60 Hz × 7.5 kB, 5 of them stop reading", 50, 60,
        frozen=5, frame_bytes=7500, seconds=30,
    ),
}  # fmt: skip
QUICK = {
    "steady": Scenario("steady", "40 viewers × 30 Hz × 200 B", 40, 30, seconds=1),
    "slow": Scenario("slow", "10 viewers × 30 Hz × 7.5 kB, 1 stops reading", 10, 30, frozen=1,
                     frame_bytes=7500, seconds=2),
}  # fmt: skip


def parse() -> argparse.Namespace:
    names = [peer.name for peer in PEERS]
    parser = argparse.ArgumentParser(prog="peers", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "peer", nargs="*", help=f"beside the relay, of {', '.join(names[1:])}; all when none is named"
    )
    parser.add_argument("--only", choices=SCENARIOS, help="one of the two scenarios")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="a few viewers for a second or two")
    parser.add_argument("--out", type=Path, default=OUT)
    asked = parser.parse_args()
    unknown = [name for name in asked.peer if name not in names]
    if unknown:
        parser.error(f"no peer {unknown[0]!r}: use {', '.join(names)}")
    return asked


def measure(peer: Peer, scenario: Scenario, place: Place) -> Row:
    """One run. CannotStart when the server or the viewers did not."""
    make_stamps(place.stamps)
    with serve(peer, scenario, place) as server:
        asked = command(scenario, server, place, scenario.seconds, relay=False)
        options: Options = peer.viewers(scenario)
        asked += [str(part) for pair in options.items() for part in pair]
        row, held = play(asked, server)
        row |= {"scenario": scenario.name, "server": peer.name, "title": peer.title}
        derive(row, scenario, server, held)
        # at the full rate, whether or not the server kept it here
        row["mb_per_viewer_hour"] = row["received"] / row["messages"] * scenario.hz * 3600 / 1e6
        return row


def main() -> int:
    asked = parse()
    os.environ["NODE_PATH"] = str(NODE_MODULES)
    try:
        place = prepare(asked.out)
    except NoCompiler as e:
        print(e, file=sys.stderr)
        return 2
    about = machine()
    scenarios = QUICK if asked.quick else SCENARIOS
    chosen = [scenario for name, scenario in scenarios.items() if asked.only in (None, name)]
    peers = [peer for peer in PEERS if not asked.peer or peer.name in (RELAY, *asked.peer)]
    absent = {peer.name: why for peer in peers if (why := peer.needs()) is not None}
    rows: list[Row] = []
    for number in range(asked.rounds):
        for scenario in chosen:
            for peer in peers:
                if peer.name in absent:
                    continue
                progress(f"round {number + 1}/{asked.rounds}: {scenario.title}, {peer.name}")
                try:
                    tries = 1 if asked.quick or scenario.frozen else TRIES
                    rows.append(calmest(partial(measure, peer, scenario, place), tries) | {"round": number})
                except CannotStart as e:
                    progress("")
                    print(f"peers: {scenario.name}, {peer.name}: {e}", file=sys.stderr)
    progress("")
    print_all(rows, chosen)
    for name, why in absent.items():
        print(f"not measured: {name} ({why})")
    about |= {"load_average_after": os.getloadavg()[0]}
    report = {"machine": about, "runs": rows, "absent": absent}
    (asked.out / "peers.json").write_text(json.dumps(report, indent=1) + "\n")
    print(f"all figures: {asked.out / 'peers.json'}")
    return 0 if rows else 1


if __name__ == "__main__":
    sys.exit(main())
