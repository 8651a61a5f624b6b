"""Plants faults in product code, one at a time, and checks that the tests catch each.

python -m tools.mutants [--check] [NAME…]

tools/mutants.toml is the table of the faults. Each is written where its old text is found in product code,
its tests run, and the file is restored, also after an error, Ctrl+C or SIGTERM. A fault is caught when its
tests fail or hang. Ends with status 1 if a fault is not caught, and refuses to start while a text is not
found or its file has uncommitted changes.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "tools/mutants.toml"
LIMIT_S = 300.0  # for the tests of one fault; a longer run counts as hanging
CHECK_LIMIT_S = 1800.0  # for all tests without a fault
VITEST_FOLDERS = ("spa", "wire/typescript")
PARTS = ("wire/python", "edge-agent", "relay", *VITEST_FOLDERS)  # each with src and tests
PYTEST = (
    *(sys.executable, "-m", "pytest", "-x", "-q", "-rfE", "-m", "not full"),
    *("-p", "no:cacheprovider", "-p", "tools.mutants"),
)
VITEST = ("npx", "--no-install", "vitest", "run", "--bail=1")
FAILED = 1  # the exit status of pytest and Vitest if a test has failed; pytest has others for its own trouble
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# what both print about a failed test
CULPRIT = re.compile(
    r"^(?:FAILED|ERROR) (?:[^\s:]*/)?(?P<py>\S.*?)(?: - |$)|^ *FAIL +(?P<ts>\S.*)$", re.MULTILINE
)


class MutantError(Exception):
    """The table does not fit the code, or a file must not be changed now; one line."""


@dataclass(frozen=True)
class Mutant:
    """A fault to plant: `old` becomes `new`, and one of `tests` must fail: names of files in the part's
    tests. `harm` is what the fault would do to somebody."""

    name: str
    part: str
    harm: str
    old: str
    new: str
    tests: tuple[str, ...]


@dataclass(frozen=True)
class Placed:
    """A mutant with where it goes, and its tests. Paths start from the repository's root."""

    mutant: Mutant
    file: str
    tests: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """How a run of tests ended. `word`: "passed", "failed", "hung" or "broken" (the tests could not run);
    `culprit`: the first test that failed, or the last line of a broken run."""

    word: str
    culprit: str
    seconds: float


def read_table(path: Path = TABLE) -> list[Mutant]:
    """The table, in its order. Raises MutantError if a name is used twice."""
    with path.open("rb") as file:
        entries = tomllib.load(file)["mutant"]
    found = [Mutant(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]
    names = [mutant.name for mutant in found]
    for name in names:
        if names.count(name) > 1:
            raise MutantError(f"{name}: two mutants have this name")
    return found


def place_all(table: Sequence[Mutant], root: Path = ROOT) -> list[Placed]:
    """Find where each goes, wherever files have moved. Raises MutantError with a line for each that goes
    nowhere, or whose tests are not there."""
    sources = {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for part in PARTS
        for path in sorted((root / part / "src").rglob("*"))
        if path.suffix in (".py", ".ts", ".tsx")
    }
    placed: list[Placed] = []
    wrong: list[str] = []
    for mutant in table:
        files = [file for file, text in sources.items() for _ in range(text.count(mutant.old))]
        if len(files) != 1:
            where = f" ({', '.join(files)})" if files else ""
            wrong.append(
                f"{mutant.name}: its old text occurs {len(files)} times{where}, not once: {mutant.old}"
            )
            continue
        part = root / files[0].partition("/src/")[0]
        tests = []
        for name in mutant.tests:
            found = list((part / "tests").rglob(name))
            tests += [path.relative_to(root).as_posix() for path in found]
            if len(found) != 1:
                wrong.append(f"{mutant.name}: {len(found)} files {name} in {part.name}/tests, not one")
        placed.append(Placed(mutant, files[0], tuple(tests)))
    if wrong:
        raise MutantError("\n".join(wrong))
    return placed


@contextmanager
def plant(mutant: Mutant, path: Path) -> Iterator[None]:
    """Have the fault in this file for the duration of a `with` block.

    The time of change is restored as well, so that make rebuilds nothing and Python's bytecode stays valid.
    """
    original, times = path.read_bytes(), path.stat()
    try:
        path.write_bytes(original.replace(mutant.old.encode(), mutant.new.encode()))
        yield
    finally:
        path.write_bytes(original)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def make_commands(tests: Sequence[str]) -> list[tuple[Path, list[str]]]:
    """The commands that run these tests, each with its folder."""
    commands: list[tuple[Path, list[str]]] = []
    python = [test for test in tests if not test.endswith(".ts")]
    if python:
        commands.append((ROOT, [*PYTEST, *python]))
    for folder in VITEST_FOLDERS:
        inside = [test.removeprefix(f"{folder}/") for test in tests if test.startswith(f"{folder}/")]
        inside = [test for test in inside if test.endswith(".ts")]
        if inside:
            commands.append((ROOT / folder, [*VITEST, *inside]))
    return commands


def run_tests(tests: Sequence[str], limit_s: float, keeps_bytecode: bool = False) -> Outcome:
    """Run these tests until one fails. `keeps_bytecode`: it may be written, as no fault is planted now."""
    began_s = time.monotonic()
    for folder, command in make_commands(tests):
        try:
            status, said = _run(command, folder, began_s + limit_s - time.monotonic(), keeps_bytecode)
        except subprocess.TimeoutExpired:
            return Outcome("hung", f"no end after {limit_s:g} s", time.monotonic() - began_s)
        if status != 0:
            word = "failed" if status == FAILED else "broken"
            return Outcome(word, find_culprit(said), time.monotonic() - began_s)
    return Outcome("passed", "", time.monotonic() - began_s)


def find_culprit(said: str) -> str:
    """The first failed test in the output of pytest or Vitest; its last line if it names none."""
    said = COLOUR.sub("", said)
    found = CULPRIT.search(said)
    if found is not None:
        return str(found["py"] or found["ts"]).strip()
    return said.strip().rpartition("\n")[2][:100]


def _run(command: Sequence[str], folder: Path, limit_s: float, keeps_bytecode: bool) -> tuple[int, str]:
    """Its exit status and output. It and everything that it started end with it, also on a signal."""
    environment = {"PYTHONPYCACHEPREFIX": str(ROOT / "out/pyc"), **os.environ, "NO_COLOR": "1"}
    environment["PYTHONDONTWRITEBYTECODE"] = "" if keeps_bytecode else "1"
    with subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            said, _ = process.communicate(timeout=limit_s)
        finally:
            with suppress(ProcessLookupError):  # all have ended
                os.killpg(process.pid, signal.SIGKILL)
    return process.returncode, said


def list_changed(files: Sequence[str], root: Path = ROOT) -> list[str]:
    """Which of these files have uncommitted changes."""
    command = ["git", "status", "--porcelain", "--", *files]
    said = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout
    return [line[3:] for line in said.splitlines()]


def pytest_configure() -> None:
    """As a plugin of pytest: property tests try the same cases in every run, and look for no smaller one that
    fails."""
    from hypothesis import Phase, settings  # noqa: PLC0415 - only pytest has it loaded

    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutants", derandomize=True, database=None, phases=phases)
    settings.load_profile("mutants")


def end_on_signals() -> None:
    """Have SIGINT, SIGTERM and SIGHUP end the process through its `finally` blocks, once."""

    def end(number: int, _frame: object) -> None:
        for each in SIGNALS:
            signal.signal(each, signal.SIG_IGN)  # a file is being restored
        sys.exit(128 + number)

    for each in SIGNALS:
        signal.signal(each, end)


def _check_tests(chosen: Sequence[Placed]) -> None:
    """Raises MutantError unless their tests pass without a fault."""
    tests = list(dict.fromkeys(test for placed in chosen for test in placed.tests))
    print(f"without a fault: {len(tests)} test files …", flush=True)
    outcome = run_tests(tests, CHECK_LIMIT_S, keeps_bytecode=True)
    if outcome.word != "passed":
        raise MutantError(f"without a fault: {outcome.word}: {outcome.culprit}")
    print(f"without a fault: all pass ({outcome.seconds:.0f} s)", flush=True)


def _try_all(chosen: Sequence[Placed]) -> int:
    """Plant each and print a row about it. Returns how many were caught."""
    words = {
        "failed": "caught",
        "hung": "caught: hangs",
        "passed": "NOT CAUGHT",
        "broken": "TESTS DID NOT RUN",
    }
    wide = max(len(placed.mutant.name) for placed in chosen)
    caught = 0
    for placed in chosen:
        mutant = placed.mutant
        with plant(mutant, ROOT / placed.file):
            outcome = run_tests(placed.tests, LIMIT_S)
        caught += outcome.word in ("failed", "hung")
        word = words[outcome.word]
        print(
            f"{mutant.name:{wide}}  {word:13} {outcome.seconds:5.0f} s  {outcome.culprit}".rstrip(),
            flush=True,
        )
        if outcome.word == "passed":
            print(f"  {placed.file}: {mutant.harm}", flush=True)
    print(f"{caught} of {len(chosen)} mutants caught")
    return caught


def main() -> int:
    """Plant the faults, and return the exit status."""
    parser = argparse.ArgumentParser(prog="tools.mutants", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="of mutants in tools/mutants.toml; all by default"
    )
    parser.add_argument("--check", action="store_true", help="first see their tests pass without a fault")
    asked = parser.parse_args()
    end_on_signals()
    try:
        table = place_all(read_table())
        names = [placed.mutant.name for placed in table]
        if unknown := set(asked.names) - set(names):
            raise MutantError(f"no mutant {', '.join(sorted(unknown))}; there are {', '.join(sorted(names))}")
        changed = list_changed(sorted({placed.file for placed in table}))
        if changed:
            raise MutantError(
                f"uncommitted changes in {', '.join(changed)}: commit them or take them back first"
            )
        chosen = [placed for placed in table if not asked.names or placed.mutant.name in asked.names]
        if asked.check:
            _check_tests(chosen)
        return 0 if _try_all(chosen) == len(chosen) else 1
    except MutantError as e:
        print(f"mutants: {e}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
