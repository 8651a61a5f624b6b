"""Robots run Ubuntu 22.04: what runs beside them keeps to what Python 3.10 has."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted([*(ROOT / "edge-agent/src").rglob("*.py"), *(ROOT / "wire/python/src").rglob("*.py")])

NEW_MODULES = {"tomllib"}
NEW_NAMES = {
    "asyncio": {"TaskGroup", "Runner", "timeout", "timeout_at", "Barrier"},
    "contextlib": {"chdir"},
    "datetime": {"UTC"},
    "enum": {"StrEnum", "ReprEnum", "verify", "member", "nonmember", "property"},
    "hashlib": {"file_digest"},
    "itertools": {"batched"},
    "math": {"cbrt", "exp2", "sumprod"},
    "operator": {"call"},
    "typing": {
        "Self", "assert_never", "assert_type", "LiteralString", "Never", "NotRequired", "Required", "Unpack",
        "TypeVarTuple", "dataclass_transform", "reveal_type", "override", "ReadOnly", "TypeAliasType",
    },
}  # fmt: skip
NEW_BUILTINS = {"ExceptionGroup", "BaseExceptionGroup", "EncodingWarning", "PythonFinalizationError"}


def newer_than_310(source: str, file: str = "x.py") -> list[str]:
    """What in `source` Python 3.10 lacks, as `file:line: what`; a branch on sys.version_info is trusted."""
    try:
        tree = ast.parse(source, file, feature_version=(3, 10))
    except SyntaxError as e:
        return [f"{file}:{e.lineno}: {e.msg}"]
    trusted = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "version_info" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    found: list[tuple[ast.AST, str]] = []
    for node in ast.walk(tree):
        if id(node) in trusted:
            continue
        if isinstance(node, ast.Import):
            found += [(node, a.name) for a in node.names if a.name.split(".")[0] in NEW_MODULES]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {a.name for a in node.names}
            if node.module in NEW_MODULES:
                found.append((node, node.module))
            found += [(node, f"{node.module}.{n}") for n in names & NEW_NAMES.get(node.module, set())]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in NEW_NAMES.get(node.value.id, set()):
                found.append((node, f"{node.value.id}.{node.attr}"))
        elif isinstance(node, ast.Name) and node.id in NEW_BUILTINS:
            found.append((node, node.id))
        elif isinstance(node, getattr(ast, "TryStar", ())):
            found.append((node, "except*"))
    return [f"{file}:{getattr(node, 'lineno', 0)}: {what}" for node, what in found]


@pytest.mark.parametrize(
    "source",
    [
        "import tomllib",
        "from tomllib import loads",
        "from typing import Self",
        "import typing\nx: typing.Self",
        "from datetime import UTC",
        "from enum import StrEnum",
        "try:\n    pass\nexcept* ValueError:\n    pass",
        "raise ExceptionGroup('x', [])",
        "type X = int",
        "def f[T](x: T) -> T: ...",
    ],
)
def test_the_scan_finds(source: str) -> None:
    assert newer_than_310(source)


def test_the_scan_trusts_a_version_branch() -> None:
    branch = "if sys.version_info >= (3, 11):\n    import tomllib\nelse:\n    import tomli as tomllib\n"
    assert newer_than_310(f"import sys\n{branch}") == []


def test_edge_and_wire_keep_to_310() -> None:
    assert len(SOURCES) > 20
    assert [
        f for s in SOURCES for f in newer_than_310(s.read_text(encoding="utf-8"), str(s.relative_to(ROOT)))
    ] == []


def test_ruff_lints_them_for_310() -> None:
    for part in ("edge-agent", "wire/python"):
        file = ROOT / part / "src" / "probe.py"
        # with a newer target ruff would ask for datetime.UTC here (UP017)
        done = subprocess.run(
            [sys.executable, "-m", "ruff", "check", "--select", "UP,F", "--stdin-filename", str(file), "-"],
            input="import datetime\n\nx = datetime.timezone.utc\n",
            capture_output=True,
            text=True,
            cwd=ROOT,
            check=False,
        )
        assert done.returncode == 0, done.stdout
