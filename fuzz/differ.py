"""Whether two readers made the same of a case."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from fuzz.target import Differs, Refused

EXACT = 1 << 53  # a double knows every whole number below


def plain(value: object) -> Any:
    """As the page has it: dataclasses with their members in camelCase."""
    if is_dataclass(value):
        return {_camel(each.name): plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, (list, tuple)) else value


def _camel(name: str) -> str:
    return re.sub("_(.)", lambda found: found[1].upper(), name)


def verdict(read: Callable[[], Any], refusals: tuple[type[Exception], ...]) -> tuple[Any, str | None]:
    """What it reads, and None; or None, and why it refuses."""
    try:
        return read(), None
    except refusals as e:
        return None, str(e) or type(e).__name__


def agree(
    ours: Callable[[], Any],
    page: Callable[[], Any],
    refuses: tuple[type[Exception], ...],
    shown: Any,
    alone: tuple[str, ...] = (),
) -> None:
    """Both read it and see the same, or both refuse it.

    `shown` turns ours into plain values. `alone`: reasons for which Python may refuse what the page takes.

    Raises Differs, or one of `refuses` where both refuse.
    """
    here, why_here = verdict(ours, refuses)
    if why_here is not None and any(reason in why_here for reason in alone):
        raise refuses[0](why_here)
    there, why_there = verdict(page, (Refused,))
    if (why_here is None) != (why_there is None):
        raise Differs(f"Python {_answer(why_here)}, TypeScript {_answer(why_there)}")
    if why_here is not None:
        raise refuses[0](why_here)
    apart = difference(shown(here), there)
    if apart is not None:
        raise Differs(apart)


def _answer(why: str | None) -> str:
    return "takes it" if why is None else f"says {why[:80]!r}"


def difference(ours: Any, page: Any, at: str = "value") -> str | None:
    """The first place where they differ, Python's value first; None: they are the same."""
    if isinstance(ours, Mapping) and isinstance(page, Mapping):
        if ours.keys() != page.keys():
            return f"{at}: members differ by {sorted(ours.keys() ^ page.keys())[:3]}"
        pairs = [(ours[key], page[key], f"{at}.{key}") for key in ours]
    elif _is_list(ours) and _is_list(page):
        if len(ours) != len(page):
            return f"{at}: {len(ours)} here, {len(page)} there"
        pairs = [(one, other, f"{at}[{i}]") for i, (one, other) in enumerate(zip(ours, page, strict=True))]
    elif type(ours) in (int, float) and type(page) in (int, float):
        same = _same_number(ours, page)
        return None if same else f"{at}: {_short(ours)} here, {_short(page)} there"
    else:
        same = ours == page and type(ours) is type(page)
        return None if same else f"{at}: {_short(ours)} here, {_short(page)} there"
    return next((found for one, other, where in pairs if (found := difference(one, other, where))), None)


def _same_number(ours: float, page: float) -> bool:
    """JavaScript has doubles only, and writes large ones as if they were whole."""
    if isinstance(ours, float) or abs(ours) >= EXACT:
        ours, page = float(ours), float(page)
    return ours == page or (math.isnan(ours) and math.isnan(page))


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes))


def _short(value: Any) -> str:
    text = ascii(value)
    return text if len(text) < 80 else f"{text[:60]}…"
