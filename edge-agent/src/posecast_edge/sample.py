"""What a robot reported at one instant, as every source delivers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

# One channel of one sample. A number in the field's unit; None or NaN: no reading; flags: an int mask or
# a list of bit names.
Reading = float | int | Sequence[str] | None
Values = Sequence[Reading] | Mapping[str, Reading]

TIME_MAX_S = 1e12  # robot time: beyond it milliseconds are lost in a double


class SourceError(Exception):
    """A source cannot open or cannot continue. Its text is one line for the user."""


NOTHING: Mapping[str, str] = MappingProxyType({})


class Sample(NamedTuple):
    """What the robot reported at one instant.

    `t_s`: the robot's clock, seconds. `values`: field name → values in the order of the field's labels, or by
    label; the source does not touch them again. `info`: strings that change rarely (mode, battery name).
    `where` it was read, for messages ("line 12"). `exact`: the source had a profile and keeps to it,
    with sequences of floats (masks: ints) and None in the order of its labels; then a field is asked for only
    when it is needed. `links`: site → link of the model, where the robot itself says where its sensors sit.
    `sliding`: joints that slide, where the robot itself says so: theirs are m, m/s and N.
    `anew`: it has fields or channels that earlier samples did not have; where there is no profile the robot
    has them from now on. A source sets it seldom: viewers get another schema.
    `newest`: False when one that came after it follows at once; then it makes events, but no frame.
    """

    t_s: float
    values: Mapping[str, Values]
    info: Mapping[str, str] = NOTHING
    where: str = ""
    exact: bool = False
    links: Mapping[str, str] = NOTHING
    newest: bool = True
    anew: bool = False
    sliding: frozenset[str] = frozenset()
