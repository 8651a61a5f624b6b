"""Evaluates the expressions of a xacro file: `${2 * pi}`, `$(eval arg('x') > 1)`.

xacro passes them to Python's eval() and refuses names with two underscores, which does not prevent access to
the rest of Python (through a lambda, a generator's frame, `vars`). Here only namespaces, mappings and plain
data have attributes, and only the listed ones.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from types import CodeType
from typing import Any

ATTRIBUTE = "_posecast_attribute"  # a name that no expression may use itself
EXPRESSION_MAX = 20_000  # characters

_OF_STR = """capitalize count endswith find index isalnum isalpha isdecimal isdigit islower isspace istitle
isupper join lower lstrip partition removeprefix removesuffix replace rfind rindex rpartition rsplit rstrip
split splitlines startswith strip swapcase title upper zfill center ljust rjust"""
_OF_LIST = "append copy count extend index insert pop remove reverse sort"
_OF_DICT = "copy get items keys pop setdefault update values"
_OF_SET = "add copy difference discard intersection isdisjoint issubset issuperset remove union"
METHODS: tuple[tuple[type, frozenset[str]], ...] = (
    (str, frozenset(_OF_STR.split())),
    (dict, frozenset(_OF_DICT.split())),
    (list, frozenset(_OF_LIST.split())),
    (tuple, frozenset(("count", "index"))),
    (set, frozenset(_OF_SET.split())),
    (frozenset, frozenset(_OF_SET.split())),
    (float, frozenset(("is_integer", "real", "imag"))),
    (int, frozenset(("real", "imag", "bit_length"))),
    (complex, frozenset(("real", "imag", "conjugate"))),
)


class ExpressionRefused(Exception):
    """An expression that asks for more than data: one line."""


class _Guard(ast.NodeTransformer):
    """Turns each `a.b` into a call that looks at what `a` is, and refuses names that are Python's own."""

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if not isinstance(node.ctx, ast.Load):
            raise ExpressionRefused("an expression can't change an attribute")
        name = ast.Constant(node.attr)
        call = ast.Call(ast.Name(ATTRIBUTE, ast.Load()), [self.visit(node.value), name], [])
        return ast.copy_location(call, node)

    def visit_Name(self, node: ast.Name) -> ast.Name:
        if node.id.startswith("__") or node.id == ATTRIBUTE:
            raise ExpressionRefused(f"an expression can't use the name {node.id[:40]!r}")
        return node


def get_attribute(value: Any, name: str) -> Any:
    """`value.name`; of a mapping that xacro made, its entry. Raises ExpressionRefused for what is no data."""
    methods = next((names for kind, names in METHODS if isinstance(value, kind)), frozenset[str]())
    if name in methods:
        return getattr(value, name)
    if isinstance(value, dict) and not name.startswith("_"):
        get = getattr(type(value), "__getattr__", None)  # xacro's namespaces, and dictionaries read from YAML
        if get is not None:
            return get(value, name)
    raise ExpressionRefused(
        f"an expression can't use the attribute {name[:40]!r} of a {type(value).__name__}"
    )


def compile_expression(text: str) -> CodeType:
    """The code of an expression, in which `a.b` calls ATTRIBUTE. Raises ExpressionRefused for what is more
    than an expression over data, and what Python raises for what is no expression."""
    if len(text) > EXPRESSION_MAX:
        raise ExpressionRefused(f"an expression of more than {EXPRESSION_MAX:,} characters")
    tree = _Guard().visit(ast.parse(text.strip(), "<expression>", "eval"))
    return compile(ast.fix_missing_locations(tree), "<expression>", "eval")


def evaluate_expression(text: str, symbols: dict[str, Any], names: Mapping[str, Any] | None = None) -> Any:
    """Evaluate as Python does, but for attributes. `names`: looked at before `symbols`.

    Raises ExpressionRefused for what is more than an expression over data, and what evaluating it raises.
    """
    code = compile_expression(text)
    symbols |= {"__builtins__": {}, ATTRIBUTE: get_attribute}
    return eval(code, symbols, names)
