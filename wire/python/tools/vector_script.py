"""What the cases of `make_vectors.py` are written with: schemas, dice, a script that decodes as it goes."""

from __future__ import annotations

import json
import random
from collections.abc import Mapping, Sequence
from typing import Any

from posecast_wire import BadFrame, BaseUnknown, Decoder, Encoder, Schema, build_schema_text

Step = dict[str, object]
Case = dict[str, object]

ARM = build_schema_text(
    "arm",
    {"joint": ["SHP", "SHR", "ELB", "WRP"], "site": ["hand.mx", "hand.my", "hand.fz"], "main": ["main"]},
    [
        {"name": "ref", "labels": "joint", "unit": "rad", "scale": 0.001},
        {"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001, "rel": "ref"},
        {"name": "ft", "labels": "site", "unit": "N", "scale": 0.5},
        {"name": "volt", "labels": "main", "unit": "V", "scale": 0.05, "slow": True},
        {"name": "temp", "labels": "joint", "unit": "°C", "slow": True},
        {"name": "flags", "labels": "joint", "bits": ["homed", "enabled", "jam"]},
    ],
)
ONE = build_schema_text("one", {"x": ["x"]}, [{"name": "x", "labels": "x"}])
CHAIN = build_schema_text(
    "chain",
    {"j": ["a", "b"]},
    [
        {"name": "p", "labels": "j"},
        {"name": "q", "labels": "j", "rel": "p"},
        {"name": "r", "labels": "j", "rel": "q"},
    ],
)
WIDE = build_schema_text(
    "wide",
    {"j": [f"j{i}" for i in range(100)]},
    [{"name": "a", "labels": "j"}, {"name": "b", "labels": "j", "rel": "a"}, {"name": "c", "labels": "j"}],
)
SCHEMAS = {"arm": ARM, "one": ONE, "chain": CHAIN, "wide": WIDE}


def write_lists(lists: Mapping[str, Sequence[object]], **style: Any) -> list[str]:
    """Members of a document that are lists: one entry a line. `style`: of `json.dumps`."""
    return [
        f"{json.dumps(name)}: [\n" + ",\n".join(json.dumps(one, **style) for one in entries) + "\n]"
        for name, entries in lists.items()
    ]


def write_document(parts: Sequence[str]) -> str:
    """A document of these members."""
    return "{\n" + ",\n".join(parts) + "\n}\n"


COMPACT = (",", ":")  # separators


class Dice:
    """Numbers from `random()` alone: the one sequence Python promises never to change."""

    def __init__(self, seed: int) -> None:
        self._rng = random.Random(seed)

    def below(self, n: int) -> int:
        return int(self._rng.random() * n)

    def near(self, spread: int) -> int:
        return self.below(2 * spread + 1) - spread

    def moved(self, codes: Sequence[int], spread: int, one_in: int = 2) -> list[int]:
        return [c + self.near(spread) if self.below(one_in) == 0 else c for c in codes]


class Script:
    """Writes a case by really decoding: what is recorded is what the reference decoder said."""

    def __init__(self, name: str, why: str, *schemas: str) -> None:
        self.case: Case = {"name": name, "why": why}
        self.steps: list[Step] = []
        self._decoder = Decoder()
        for schema in schemas:
            self.learn(schema)

    def learn(self, name: str) -> None:
        self._decoder.add_schema(SCHEMAS[name])
        self.steps.append({"schema": name})

    def frame(
        self, data: bytes, note: str = "", says_why: bool = False, also: Mapping[str, object] | None = None
    ) -> None:
        """`says_why`: a refusal is in these words, in every language."""
        step: Step = {"note": note} if note else {}
        step["frame"] = data.hex()
        try:
            got = self._decoder.decode(data)
            step |= {"is": "state", "seq": got.seq, "t": got.t_s, "codes": list(got.codes)}
        except BaseUnknown:
            step["is"] = "unknown"
        except BadFrame as e:
            step["is"] = "bad"
            if says_why:
                step["says"] = str(e)
        self.steps.append(step | dict(also or {}))

    def done(self) -> Case:
        return self.case | {"steps": self.steps}


class Stream(Script):
    """A case made by an encoder, which another encoder can make again."""

    def __init__(self, name: str, why: str, schema: str, key_interval_s: float = 4.0) -> None:
        super().__init__(name, why, schema)
        self.case["encode"] = {"schema": schema, "key_interval_s": key_interval_s}
        self.size = Schema.parse(SCHEMAS[schema]).size
        self._encoder = Encoder(Schema.parse(SCHEMAS[schema]), key_interval_s)
        self.frames: list[bytes] = []

    def send(
        self, codes: Sequence[int], seq: int, t: float, now: float | None = None, force_key: bool = False
    ) -> bytes:
        now = t if now is None else now
        data = self._encoder.encode(codes, seq, t, now, force_key)
        also: Step = {"from": {"codes": list(codes), "seq": seq, "t": t, "now": now}}
        if force_key:
            also["from"] = {"codes": list(codes), "seq": seq, "t": t, "now": now, "force_key": True}
        self.frames.append(data)
        self.frame(data, also=also)
        return data
