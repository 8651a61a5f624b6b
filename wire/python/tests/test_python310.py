"""Robots run Ubuntu 22.04: this package keeps to the standard library of Python 3.10."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src/posecast_wire"
NEWER = {
    "enum": {"StrEnum", "verify", "member", "nonmember"},
    "datetime": {"UTC"},
    "typing": {
        "Self",
        "assert_never",
        "Never",
        "LiteralString",
        "Required",
        "NotRequired",
        "Unpack",
        "override",
    },
    "asyncio": {"TaskGroup", "timeout", "Runner"},
    "itertools": {"batched"},
    "tomllib": {"load", "loads"},
}


def test_imports_are_old_and_few() -> None:
    for path in SOURCE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"), feature_version=(3, 10))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                modules, names = [a.name for a in node.names], set[str]()
            elif isinstance(node, ast.ImportFrom):
                modules, names = [node.module or ""], {a.name for a in node.names}
            else:
                continue
            for module in modules:
                top = module.partition(".")[0]
                allowed = sys.stdlib_module_names | {"posecast_wire", "fnv_hash_fast"}
                assert top in allowed, f"{path.name}: {module}"
                assert top != "tomllib", path.name
                assert not names & NEWER.get(top, set()), f"{path.name}: {module}"
