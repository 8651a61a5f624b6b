"""What a robot reported at one instant, as every source delivers it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

# One channel of one sample. A number in the field's unit; None or NaN: no reading; flags: an int mask or
# a list of bit names.
Reading = float | int | Sequence[str] | None
Values = Sequence[Reading] | Mapping[str, Reading]

TIME_MAX_S = 1e12  # robot time: beyond it a double loses the milliseconds
WORDS = (str, bytes, bytearray, bool)  # float() accepts them, but they are not meant as numbers


class SourceError(Exception):
    """A source can't open or can't continue. The message is one line for the user."""


NOTHING: Mapping[str, str] = MappingProxyType({})


class Sample(NamedTuple):
    """What the robot reported at one instant.

    `t_s`: the robot's clock, seconds; `kit.now_s()` if it has none. `values`: field name → values in the
    order of the field's labels, or by label; the source must not change them afterwards. `info`: strings
    that change rarely (mode, battery name). `where`: the place it was read from, for messages ("line
    12"). `exact`: the values follow the source's profile: sequences of floats (masks: ints) and None in
    the order of its labels; a field is then read only when it is needed. `links`: site → link of the
    model, if the robot reports where its sensors are mounted. `sliding`: joints that the robot reports as
    sliding: their units are m, m/s and N. `newest`: False when a newer sample follows at once; it then
    causes events, but no frame.
    """

    t_s: float
    values: Mapping[str, Values]
    info: Mapping[str, str] = NOTHING
    where: str = ""
    exact: bool = False
    links: Mapping[str, str] = NOTHING
    newest: bool = True
    sliding: frozenset[str] = frozenset()
