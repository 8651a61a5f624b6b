"""`python -m tests.attack [WHAT …]`: attacks a relay while an innocent robot and viewer use it (`make
attack`).

Each attack gets its own relay. If it harms the innocent more than promised, it is repeated and reported, more
often while other programs use this machine's CPU. The exit code is 1 if it keeps failing. ATTACK_SECONDS=60
in the environment sets the length of each attack.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from tests.attack import crowds, document
from tests.attack.attacks import ATTACKS
from tests.attack.figure import Figure
from tests.attack.playing import played
from tests.attack.recoveries import recoveries
from tests.attack.row import WAITED_S, Row, cells, misses
from tests.attack.target import SECONDS, Attack

STAGES: dict[str, Callable[[tuple[str, ...]], list[Figure]]] = {
    "robots-100": crowds.beside_a_flood,
    "viewers-1000": crowds.coming_at_once,
    "recoveries": recoveries,
}
TURNS_MAX = 4
COLUMNS = ("frames", "gap s", "newcomer", "+ MB", "lines/s")


def options() -> argparse.Namespace:
    """From the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.attack", description="Attacks on a relay.")
    parser.add_argument("what", nargs="*", help="attacks and stages; all when none is named")
    parser.add_argument("--list", action="store_true", help="what there is")
    parser.add_argument("--write", action="store_true", help=f"the table, into {document.FILE.name}")
    own = str(Path(sys.executable).parent / "posecast-relay")
    parser.add_argument("--relay", default=own, metavar="COMMAND", help="which relay; default: this one")
    asked = parser.parse_args()
    for name in asked.what:
        if name not in ATTACKS and name not in STAGES:
            parser.error(f"no {name!r}: see --list")
    if asked.write and asked.what:
        parser.error("--write: the table has all of them")
    return asked


class Run:
    """All rows, and the broken promises."""

    def __init__(self, relay: tuple[str, ...]) -> None:
        self._relay = relay
        self._stretch_s = float(os.environ.get("ATTACK_SECONDS", "0"))
        self.rows: list[Row] = []
        self.figures: list[Figure] = []
        self.broken: list[str] = []
        print(f"{'':30}{''.join(f'{column:>9}' for column in COLUMNS)}  what it did")
        self._control = self._play(None)
        self.broken += misses(self._control, None)
        self.rows.append(self._control)

    def _play(self, attack: Attack | None) -> Row:
        row = played(attack, self._stretch_s or (attack.seconds if attack else SECONDS), self._relay)
        did, *numbers = cells(row)
        print(f"{row.name:30}{''.join(f'{cell:>9}' for cell in numbers)}  {did}", flush=True)
        return row

    def attack(self, name: str) -> None:
        """Repeated once if needed, more often while other programs use the CPU; with a control run at that
        time."""
        row = self._play(ATTACKS[name])
        for turn in range(TURNS_MAX - 1):
            found = misses(row, self._control)
            if not found or (turn > 0 and row.waited_s <= WAITED_S):
                break
            print("".join(f"    {miss}\n" for miss in found) + "    once more:")
            self._control = self._play(None)
            row = replace(self._play(ATTACKS[name]), again=True)
        self.rows.append(row)
        self.broken += misses(row, self._control)

    def _measure(self, name: str) -> list[Figure]:
        try:
            found = STAGES[name](self._relay)
        except AssertionError as e:  # from `until`: something expected never arrived
            found = [Figure(f"{name}: {str(e).splitlines()[0]}", float("inf"), 0.0, "")]
        print("".join(f"    {figure}\n" for figure in found), end="", flush=True)
        return found

    def stage(self, name: str) -> None:
        """Likewise."""
        print(f"\n{name}", flush=True)
        found = self._measure(name)
        if not all(figure.kept for figure in found):
            print("    once more:")
            found = self._measure(name)
        self.figures += found
        self.broken += [str(figure) for figure in found if not figure.kept]


def main() -> int:
    """0: all as promised."""
    asked = options()
    if asked.list:
        lines = [f"{attack.name:30} {attack.what}" for attack in ATTACKS.values()]
        print("\n".join([*lines, *STAGES]))
        return 0
    began_s = time.monotonic()
    run = Run(tuple(shlex.split(asked.relay)))
    for name in ATTACKS if not asked.what else [name for name in asked.what if name in ATTACKS]:
        run.attack(name)
    for name in STAGES if not asked.what else [name for name in asked.what if name in STAGES]:
        run.stage(name)
    print(f"\n{time.monotonic() - began_s:.0f} s")
    for miss in run.broken:
        print(f"NOT KEPT {miss}")
    if asked.write and not run.broken:
        document.write(run.rows, run.figures)
    return 1 if run.broken else 0


if __name__ == "__main__":
    sys.exit(main())
