"""The page on the Python module `posecast`, written from its signatures and docstrings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import griffe

HEAD = """# Python API

Everything in the module `posecast`, generated from its docstrings. For examples see
[publish from Python](../how-to/robots/python.md).
"""
SEARCHED = ("edge-agent/src", "wire/python/src")
STARS = {griffe.ParameterKind.var_positional: "*", griffe.ParameterKind.var_keyword: "**"}
TYPE_CHECKERS_ONLY = ("wrong",)  # a parameter that nobody passes


def write_python_page(root: Path) -> str:
    """The page for the module in a checkout."""
    paths = [root / path for path in SEARCHED]
    module = griffe.load("posecast", search_paths=paths, resolve_aliases=True, resolve_external=True)
    lines = [HEAD]
    for name in sorted(map(str, module.exports or ())):
        found = module[name]
        lines += _write_class(found.final_target if isinstance(found, griffe.Alias) else found)
    return "\n".join(lines)


def _write_class(found: griffe.Object | griffe.Alias) -> Iterator[str]:
    yield from (f"## `posecast.{found.name}`", "", _read_docstring(found), "")
    for member in found.members.values():
        if isinstance(member, griffe.Function) and _is_shown(member):
            is_new = member.name == "__init__"
            yield from (f"### {'Create one' if is_new else f'`{member.name}()`'}", "")
            yield from (
                "```python",
                _write_signature(found.name if is_new else member.name, member),
                "```",
                "",
            )
            yield from (_read_docstring(member), "")
    attributes = [
        each for each in found.members.values() if isinstance(each, griffe.Attribute) and each.annotation
    ]
    if any(_is_public(each) for each in attributes):
        yield from ("| attribute | type |", "|---|---|")
        yield from (f"| `{each.name}` | `{each.annotation}` |" for each in attributes if _is_public(each))
        yield ""


def _is_shown(found: griffe.Function) -> bool:
    """What a dataclass makes by itself has no words of its own."""
    return bool(_read_docstring(found)) and (found.name == "__init__" or _is_public(found))


def _is_public(found: griffe.Object) -> bool:
    return not found.name.startswith("_")


def _read_docstring(found: griffe.Object | griffe.Alias) -> str:
    return "" if found.docstring is None else found.docstring.value


def _write_signature(name: str, function: griffe.Function) -> str:
    parts: list[str] = []
    for each in function.parameters:
        if each.name == "self":
            continue
        is_named = each.kind is griffe.ParameterKind.keyword_only
        if is_named and "*" not in parts:
            parts.append("*")
        if each.name not in TYPE_CHECKERS_ONLY:
            parts.append(_write_parameter(each))
    returns = "" if function.returns is None or function.name == "__init__" else f" -> {function.returns}"
    lines = "".join(f"\n    {part}," for part in parts) + "\n" if len(parts) > 2 else ", ".join(parts)
    return f"{name}({lines}){returns}"


def _write_parameter(parameter: griffe.Parameter) -> str:
    stars = STARS.get(parameter.kind, "") if parameter.kind is not None else ""
    text = f"{stars}{parameter.name}"
    if parameter.annotation is not None:
        text += f": {parameter.annotation}"
    return text if parameter.default is None or stars else f"{text} = {parameter.default}"
