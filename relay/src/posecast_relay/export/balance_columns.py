"""Balance in CSV: what the columns are called, and their cells."""

from __future__ import annotations

from posecast_wire.mapping import Xyz

from posecast_relay.balance.balance import Balance

BALANCE_COLUMNS = (
    *(f"balance.centre_of_mass.{axis} [m]" for axis in "xyz"),
    *(f"balance.capture_point.{axis} [m]" for axis in "xy"),
    *(f"balance.centre_of_pressure.{axis} [m]" for axis in "xy"),
    "balance.floor [m]",
    "balance.margin [mm]",
)
NOTHING = ("",) * len(BALANCE_COLUMNS)
METRE_DECIMALS, MM_DECIMALS = 4, 1


def write_balance(balance: Balance | None) -> tuple[str, ...]:
    """The cells of a row; empty where a value is none."""
    if balance is None:
        return NOTHING
    margin_mm = None if balance.margin_m is None else 1000 * balance.margin_m
    return (
        *_write_point(balance.centre_of_mass, 3),
        *_write_point(balance.capture_point, 2),
        *_write_point(balance.pressure, 2),
        _write(balance.floor_m, METRE_DECIMALS),
        _write(margin_mm, MM_DECIMALS),
    )


def _write_point(point: Xyz | None, axes: int) -> list[str]:
    return [""] * axes if point is None else [_write(each, METRE_DECIMALS) for each in point[:axes]]


def _write(value: float | None, decimals: int) -> str:
    """Without a minus before zeros."""
    if value is None:
        return ""
    text = f"{value:.{decimals}f}"
    return text[1:] if text[0] == "-" and not text.strip("-0.") else text
