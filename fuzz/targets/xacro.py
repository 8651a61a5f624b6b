"""Expressions of xacro: what is let through asks for no attribute but by way of our guard, and for none of
Python's own names. They are compiled and not run: that is done in a process of its own, bounded."""

from __future__ import annotations

import dis
from types import CodeType

from posecast_edge.model.xacro.child import ExpressionRefused, compile_expression

from fuzz.target import Differs, Target

ASKING = {"LOAD_ATTR", "LOAD_METHOD", "STORE_ATTR", "DELETE_ATTR", "IMPORT_NAME", "IMPORT_FROM"}


def expression(data: bytes) -> None:
    """What is no expression for Python is none of the guard's."""
    text = data.decode("utf-8", "replace")
    try:
        waiting = [compile_expression(text)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    while waiting:
        code = waiting.pop()
        waiting += [one for one in code.co_consts if isinstance(one, CodeType)]
        before: object = None
        for step in dis.get_instructions(code):
            # how Python's compiler itself puts an f-string of many parts together
            is_fstring = step.argval == "join" and before == ""
            before = step.argval
            if step.opname in ASKING and not is_fstring:
                raise Differs(f"{step.opname} {step.argval!a} is let through")
        if any(name.startswith("__") for name in code.co_names):
            raise Differs("a name of Python's own is let through")


TARGETS = (Target("xacro", expression, (ExpressionRefused,)),)
