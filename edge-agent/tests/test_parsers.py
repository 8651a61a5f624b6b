"""Every parser is in the table, and whatever it is given it answers or refuses in one line."""

from __future__ import annotations

import ast
import importlib
import itertools
import random
import re
import warnings
from collections.abc import Iterator
from pathlib import Path

import mesh_parsers
import message_parsers
import model_parsers
import posecast_edge
import pytest
import recording_parsers
import scene_parsers
import sdf_parsers
import settings_parsers
from cost_stage import SLACK, SPAN, assert_time_in_proportion
from model_stage import PICTURE
from parser_stage import Input, Parser, Work, held_bytes, in_one_line
from posecast_edge.sources.registry import KINDS
from posecast_testing import count_examples

PARSERS = {
    parser.name: parser
    for parser in itertools.chain(
        mesh_parsers.PARSERS,
        scene_parsers.PARSERS,
        model_parsers.PARSERS,
        sdf_parsers.PARSERS,
        recording_parsers.PARSERS,
        message_parsers.PARSERS,
        settings_parsers.PARSERS,
    )
}

PACKAGE = Path(posecast_edge.__file__).parent
READS = re.compile(r"(?:decode|feed|fit|load|parse|read|unpack|validate)(?:_|$)")
# what is called so and reads nothing that a stranger wrote, or is measured elsewhere
ELSEWHERE = {
    "cli.flags.parse_folders": "a flag",
    "cli.flags.parse_xacro_argument": "a flag: test_xacro.py",
    "cli.settings.read_proof": "flags: test_cli.py",
    "cli.settings.read_route": "flags: test_route.py",
    "uplink.route.parse_proxy": "a flag, and the environment: test_route.py",
    "sources.clock.read_time": "a value of JSON, or of a Python program: test_jsonl.py",
    "sources.demo.read_motion": "a file of our own",
    "sources.mujoco.model.load_simulation": "test_hostile_mujoco.py: MuJoCo reads",
    "model.mjcf.reader.load_mjcf": "test_hostile_mjcf.py: MuJoCo reads, in a process of its own",
    "model.mjcf.compiled.read_model": "fuzz/targets/models.py: what that process answers",
    "model.robot_file.load_robot_file": "one of the others",
}
# the kinds of sources, and which parsers read for each
BY_KIND = {
    "jsonl": {"jsonl"},
    "csv": {"csv", "playback"},
    "mcap": {"mcap", "playback", "cdr"},
    "bag": {"bag of ROS 1", "bag of ROS 2", "mcap", "playback", "cdr"},
    "trajectory": {"trajectory"},
    "mujoco": {"mujoco"},
    "demo": set[str](),  # made by itself
    "hubo-ach": {"ach", "achd", "hubo_state"},
    "ros2": {"cdr"},
    "rosbridge": {"rosbridge", "cbor"},
}
CASES = 2 * count_examples(75)  # `make test` tries others with `make fuzz`
STRANGE = [
    *(b"1e999 -1e999 nan Infinity 1e-320 1e308 -0 99999999999 1_0 0x10 null true {} [] .. %00 &#0;".split()),
    *(b"-9223372036854775809", b"9223372036854775807", b"9" * 5000, b"9" * 30, b"-1", b"", b"\0", b"\xff"),
    *(b"[" * 985, b"[" * 5000, b'{"a":' * 300, b"<a>" * 60, b"\\ud800", b"&#xD800;", "١".encode()),
    *(b"\xef\xbb\xbf", b"\xed\xa0\x80", "\u202e".encode(), b"\r", b"\n", b"\t", b" ", b"\\", b"'", b'"'),
    *(b"[[", b"]]", b'"""', b"=", b"a.b.c.d", b"{a={a={a=1}}}", b"1979-05-27T00:00:00Z"),
    *(b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\xff" * 8, b"\0" * 8, b","),
]
WORD = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|[A-Za-z_#.:/-]{2,}")


def readers() -> Iterator[str]:
    """The public functions and methods of the package that read something."""
    for file in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(file.relative_to(PACKAGE).with_suffix("").parts)
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and READS.match(node.name):
                yield f"{module}.{node.name}"
            elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                for inner in node.body:
                    if isinstance(inner, ast.FunctionDef) and READS.match(inner.name):
                        yield f"{module}.{node.name}.{inner.name}"


def test_every_reader_is_in_the_table() -> None:
    known = {name for parser in PARSERS.values() for name in parser.reads} | set(ELSEWHERE)
    assert set(readers()) == known


def test_every_kind_of_source_is_in_the_table() -> None:
    assert set(BY_KIND) == set(KINDS)
    assert set().union(*BY_KIND.values()) <= set(PARSERS)


@pytest.mark.parametrize("name", PARSERS)
def test_good_input_is_read(name: str, tmp_path: Path) -> None:
    parser = PARSERS[name]
    assert parser.good
    for number, data in enumerate(parser.good):
        folder = tmp_path / str(number)
        folder.mkdir()
        parser.work(Input(data, BESIDE), folder)()


BESIDE = {"a.mtl": b"newmtl m\nKd 1 0 0\nmap_Kd a.png\nnewmtl k\nd 0.5\n", "a.png": PICTURE}


@pytest.mark.parametrize("name", PARSERS)
def test_spoiled_input_is_read_or_refused(name: str, tmp_path: Path) -> None:
    parser = PARSERS[name]
    dice = random.Random(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nor may it write to stderr
        for _ in range(CASES):
            data = spoiled(dice, dice.choice(parser.good), parser.good)
            with in_one_line(*parser.refuses):
                parser.work(Input(data, BESIDE), tmp_path)()


def spoiled(dice: random.Random, data: bytes, others: tuple[bytes, ...]) -> bytes:
    """One to four changes: words replaced, cut, doubled, put in, taken from another place."""
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        words = list(WORD.finditer(data[:50_000]))
        at, size = dice.randrange(len(data) + 1), dice.choice((0, 1, 4, 8, 40))
        kind = dice.randrange(8)
        if kind < 3 and words:
            word, new = dice.choice(words), dice.choice(STRANGE)
            new = new if kind else dice.choice(words)[0]
            data = data[: word.start()] + new + data[word.end() :]
        elif kind == 3:
            data = data[:at]
        elif kind == 4:
            data = data[:at] + data[at : at + size] * dice.choice((0, 2, 30)) + data[at + size :]
        elif kind == 5:
            other = dice.choice(others)
            data = data[:at] + other[dice.randrange(len(other) + 1) :]
        elif kind == 6:
            data = data[:at] + dice.randbytes(min(size, 8)) + data[at + min(size, 8) :]
        else:
            data = data[:at] + dice.choice(STRANGE) + data[at + size :]
    return data


# --- time and memory of every parser grow no faster than its input, of the worst kind that is known

WORST = [(name, kind) for name, parser in PARSERS.items() for kind in parser.worst]
BYTES = 1 << 20  # whatever the input


def prepared(parser: Parser, kind: str, n: int, folder: Path) -> Work:
    """One run; what it may refuse it may."""
    folder.mkdir()
    work = parser.work(parser.worst[kind].input(n), folder)

    def run() -> None:
        with in_one_line(*parser.refuses):
            work()

    return run


def lower_bounds(parser: Parser, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for place, value in parser.worst[kind].bounds.items():
        module, _, name = place.rpartition(".")
        monkeypatch.setattr(importlib.import_module(module), name, value, raising=False)


@pytest.mark.parametrize(("name", "kind"), WORST)
def test_time(name: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parser = PARSERS[name]
    lower_bounds(parser, kind, monkeypatch)
    assert_time_in_proportion(lambda n: prepared(parser, kind, n, tmp_path / str(n)), parser.worst[kind].n)


# what takes memory with the square takes such time too: test_time. Tracing costs ten times as much
@pytest.mark.full
@pytest.mark.parametrize(("name", "kind"), WORST)
def test_memory(name: str, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parser = PARSERS[name]
    lower_bounds(parser, kind, monkeypatch)
    n = parser.worst[kind].n
    small, large = (held_bytes(prepared(parser, kind, n * k, tmp_path / str(k))) for k in (1, SPAN))
    assert large < SPAN * SLACK * small + BYTES
