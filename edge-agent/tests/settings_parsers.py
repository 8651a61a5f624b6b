"""Parsers of what a robot's owner writes beside its model, with the worst input that is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from edge_stage import PROFILE
from parser_stage import Input, Parser, Work, Worst, written
from posecast_edge.cli.settings import UsageError, parse_settings
from posecast_edge.profile.reader import ProfileError, load_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_wire.credential import LINE_MAX
from posecast_wire.schema import Schema

BASE = '[labels]\njoint=["A","B"]\n[[fields]]\nname="pos"\n'
VIEWS = """
[views.public]
fields = ["pos", "flags"]
hz = 10
scales = { pos = 0.01 }
[views.lab]
"""


def profile_work(given: Input, folder: Path) -> Work:
    """And the schema that is made of it."""
    path = written(given, folder, "p.toml")
    return lambda: Schema.parse(make_schema_text(load_profile(path)))


def credential_work(given: Input, folder: Path) -> Work:
    """As the command line names it."""
    path = written(given, folder, "r1.credential")
    path.chmod(0o600)
    line = ["run", "--source", "jsonl", "--relay", "tls/relay:7447", "--credential", str(path)]
    return lambda: parse_settings(line, {})


def labels(n: int) -> str:
    return ", ".join(f"'j{i}'" for i in range(n))


TEXTS: dict[str, Callable[[int], str]] = {
    "comments": lambda n: BASE + "#\n" * n + "x=1\n",
    "unknown tables": lambda n: "".join(f"[t{i}]\n" for i in range(n)),
    "fields": lambda n: (
        "[labels]\nl=['a']\n" + "".join(f"[[fields]]\nname='f{i}'\nlabels='l'\n" for i in range(n))
    ),
    "labels": lambda n: f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n",
    "a label twice": lambda n: f"[labels]\njoint=[{labels(n)}, 'j0']\n[[fields]]\nname='pos'\n",
    "names": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n[names]\n"
        + "".join(f"j{i}='x'\n" for i in range(n))
    ),
    "names in a language": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n[names.ko]\n"
        + "".join(f"j{i}='x'\n" for i in range(n))
    ),
    "joints": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n[joints]\n"
        + "".join(f"k{i}.terms=[['j{i}',2]]\n" for i in range(n))
    ),
    "joints that follow": lambda n: (
        BASE + "[joints]\n" + "".join(f"j{i}.terms=[['j{i + 1}',1]]\n" for i in range(n))
    ),
    "units": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n"
        + "units={"
        + ",".join(f"j{i}='mm'" for i in range(n))
        + "}\n"
    ),
    "thresholds": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n[thresholds.pos]\n"
        + "".join(f"j{i}={{high=1}}\n" for i in range(n))
    ),
    "corners of a sole": lambda n: (
        BASE + "[balance]\nsoles.RF=[" + ",".join(f"[{i},{i * i},0]" for i in range(n)) + "]\n"
    ),
    "feet": lambda n: BASE + f"[balance]\nfeet=[{labels(n)}]\n",
    "tolerances": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n[tolerance]\n"
        + "".join(f"j{i}=1\n" for i in range(n))
    ),
    "columns": lambda n: (
        f"[labels]\njoint=[{labels(n)}]\n[[fields]]\nname='pos'\n"
        + f"[trajectory]\nrate_hz=1\ncolumns=[{labels(n)}]\n"
    ),
    "a view": lambda n: (
        "[labels]\nl=['a']\n"
        + "".join(f"[[fields]]\nname='f{i}'\nlabels='l'\n" for i in range(n))
        + "[views.lab]\nfields=["
        + ", ".join(f"'f{i}'" for i in range(n))
        + "]\n"
    ),
}
LONG: dict[str, Callable[[int], str]] = {
    "a dotted key": lambda n: BASE + "a." * n + "b=1\n",
    "a dotted header": lambda n: BASE + "[" + "a." * n + "b]\n",
    "many dots": lambda n: BASE + "x=[" + "0.5, " * n + "]\n",
    "a long word": lambda n: BASE + "a" * n + "\n",
    "quotes": lambda n: BASE + "x=" + "'" * n + "\n",
    "digits": lambda n: BASE + "scale=" + "9" * n + "\n",
    "underscores": lambda n: BASE + "scale=" + "1_" * n + "1\n",
    "brackets": lambda n: BASE + "x=" + "[" * n + "\n",
    "blanks": lambda n: BASE + "scale=1" + " " * n + "x\n",
}  # fmt: skip


def encoded(text: Callable[[int], str]) -> Callable[[int], bytes]:
    return lambda n: text(n).encode()


CREDENTIAL = b"posecast1:r1:" + b"s" * 43
SIXTEENTH = LINE_MAX // 16 - 10  # a longer file is not read

PARSERS = (
    Parser(
        "profile",
        ("profile.reader.load_profile", "profile.reader.parse_profile"),
        profile_work,
        (ProfileError,),
        (BASE.encode(), PROFILE.encode(), (PROFILE + VIEWS).encode()),
        {
            kind: Worst(encoded(text), least)
            for least, texts in ((250, TEXTS), (2500, LONG))
            for kind, text in texts.items()
        },
    ),
    Parser(
        "credential",
        ("cli.settings.parse_settings", "uplink.credentials.read_credential"),
        credential_work,
        (UsageError,),
        (CREDENTIAL + b"\n", CREDENTIAL + b":TUlJQg==\r\n"),
        {
            "an authority": Worst(lambda n: CREDENTIAL + b":" + b"TUlJ" * (n // 4), SIXTEENTH),
            "colons": Worst(lambda n: b"posecast1" + b":" * n, SIXTEENTH),
            "empty lines": Worst(lambda n: b"\r\n" * (n // 2) + CREDENTIAL, SIXTEENTH),
            "blanks": Worst(lambda n: CREDENTIAL + b" " * n + b"x", SIXTEENTH),
            "a name": Worst(lambda n: b"posecast1:" + b"r" * n + b":" + b"s" * 43, SIXTEENTH),
            "without end": Worst(lambda n: b"posecast1:" * n, 100_000),
        },
    ),
)
