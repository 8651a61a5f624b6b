"""What there is to say of a parser: how it is called, how it refuses, good input, and the worst input of any
length that is known. *_parsers.py have the parsers, test_parsers.py the tests that each of them
has to pass.
"""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

Work = Callable[[], object]


@dataclass(frozen=True)
class Input:
    """A file's content, and the files beside it."""

    data: bytes
    beside: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Worst:
    """Input that gives as much work as so many bytes can. `make(n)` grows with n; `n`: the smallest that is
    measured. `bounds`: what stands in the way of small inputs, as `module.NAME`, and how low it is set."""

    make: Callable[[int], bytes | Input]
    n: int
    bounds: Mapping[str, int] = field(default_factory=dict)

    def input(self, n: int) -> Input:
        made = self.make(n)
        return made if isinstance(made, Input) else Input(made)


@dataclass(frozen=True)
class Parser:
    """`reads`: the functions that it stands for, as `model.obj.read_obj`. `work` prepares what is measured,
    in a folder of its own. `refuses`: all it may raise, each one line for a person."""

    name: str
    reads: tuple[str, ...]
    work: Callable[[Input, Path], Work]
    refuses: tuple[type[Exception], ...]
    good: tuple[bytes, ...]
    worst: Mapping[str, Worst]


def held_bytes(work: Work) -> int:
    """The most that it holds at a time, beside what there was before."""
    gc.collect()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@contextmanager
def in_one_line(*refusals: type[Exception]) -> Iterator[None]:
    """What happens inside may be refused, in one line that a person can read."""
    try:
        yield
    except refusals as e:
        said = str(e)
        good = said.isprintable() and 0 < len(said) < 700
        if not good:
            raise AssertionError(f"{type(e).__name__} says {said[:200]!a}") from e


def written(given: Input, folder: Path, name: str) -> Path:
    """The input as a file, with those beside it."""
    for other, data in given.beside.items():
        (folder / other).write_bytes(data)
    path = folder / name
    path.write_bytes(given.data)
    return path
