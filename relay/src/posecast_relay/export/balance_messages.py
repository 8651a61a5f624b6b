"""Balance as messages of ROS 2."""

from __future__ import annotations

import math
from collections.abc import Iterator

from posecast_wire.mapping import Xyz

from posecast_relay.balance.balance import Balance
from posecast_relay.export.cdr import CdrMessage
from posecast_relay.export.ros_messages import NUMBER, POINT, lay_number, lay_point

NOWHERE: Xyz = (math.nan, math.nan, math.nan)


class BalanceMessages:
    """The messages of one model's frames. `world`: what the points are in."""

    def __init__(self, world: str) -> None:
        self._point, self._point_at = lay_point(world)
        self._number, self._number_at = lay_number()

    def fill(self, unix_ns: int, balance: Balance) -> Iterator[tuple[str, str, bytes]]:
        """Topic, type and message of each; NaN where a value is none now. There is none of what this robot
        can't have: without masses, or feet."""
        if balance.mass_kg:
            yield "/balance/centre_of_mass", POINT, self._fill_point(unix_ns, balance.centre_of_mass)
        if balance.feet:
            yield "/balance/centre_of_pressure", POINT, self._fill_point(unix_ns, balance.pressure)
        if balance.mass_kg and balance.feet:
            yield "/balance/capture_point", POINT, self._fill_point(unix_ns, balance.capture_point)
            margin_m = math.nan if balance.margin_m is None else balance.margin_m
            yield "/balance/margin", NUMBER, self._fill(self._number, self._number_at, (margin_m,))

    def _fill_point(self, unix_ns: int, point: Xyz | None) -> bytes:
        self._point.set_stamps(unix_ns)
        return self._fill(self._point, self._point_at, NOWHERE if point is None else point)

    def _fill(self, message: CdrMessage, at: int, numbers: tuple[float, ...]) -> bytes:
        message.set_numbers(at, numbers)
        return bytes(message)
