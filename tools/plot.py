"""Small plots as SVG text, without a library: lines over logarithmic axes, and bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 640, 320
LEFT, RIGHT, TOP, BOTTOM = 64, 150, 34, 44
COLOURS = ("#0b7285", "#c2410c", "#6d28d9", "#4d7c0f", "#9d174d", "#1f2937")
DASHES = ("", "7 4", "2 3", "10 3 2 3", "4 2", "1 4")  # so that colour is never the only difference
SUFFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
BAR, GAP = 18, 8


@dataclass(frozen=True)
class Line:
    """One curve. All coordinates above zero."""

    name: str
    points: Sequence[tuple[float, float]]


def short(value: float) -> str:
    """1500000 → 1.5M"""
    for size, suffix in SUFFIXES:
        if value >= size:
            return f"{value / size:g}{suffix}"
    return f"{value:g}"


def _svg(height: float, title: str, body: Sequence[str]) -> str:
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}" role="img">'
    style = "text{font:12px system-ui,sans-serif;fill:#1f2937}.t{font-weight:600;font-size:14px}"
    paper = f'<rect width="{WIDTH}" height="{height:g}" rx="8" fill="#fff"/>'
    named = f'<title>{escape(title)}</title><text class="t" x="16" y="22">{escape(title)}</text>'
    return "\n".join([head, f"<style>{style}</style>", paper, named, *body, "</svg>", ""])


def _decades(values: Sequence[float]) -> tuple[int, int]:
    low, high = floor(log10(min(values)) + 1e-9), ceil(log10(max(values)) - 1e-9)
    return low, max(high, low + 1)


def lines(title: str, x_name: str, y_name: str, curves: Sequence[Line]) -> str:
    """Lines over logarithmic axes, with labels. Raises ValueError unless all coordinates are positive."""
    every = [point for curve in curves for point in curve.points]
    if not every or min(min(point) for point in every) <= 0:
        raise ValueError(f"{title}: a logarithmic plot needs points above 0")
    (x0, x1), (y0, y1) = (_decades([point[i] for point in every]) for i in (0, 1))

    def x(value: float) -> float:
        return round(LEFT + (log10(value) - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT), 1)

    def y(value: float) -> float:
        return round(HEIGHT - BOTTOM - (log10(value) - y0) / (y1 - y0) * (HEIGHT - TOP - BOTTOM), 1)

    body: list[str] = []
    for power in range(x0, x1 + 1):
        at = x(10.0**power)
        body.append(f'<path d="M{at} {TOP}V{HEIGHT - BOTTOM}" stroke="#e5e7eb"/>')
        body.append(
            f'<text x="{at}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{short(10.0**power)}</text>'
        )
    for power in range(y0, y1 + 1):
        at = y(10.0**power)
        body.append(f'<path d="M{LEFT} {at}H{WIDTH - RIGHT}" stroke="#e5e7eb"/>')
        body.append(f'<text x="{LEFT - 6}" y="{at + 4}" text-anchor="end">{short(10.0**power)}</text>')
    taken: list[float] = []
    for number, curve in enumerate(curves):
        colour, dash = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
        path = " ".join(f"{x(a)},{y(b)}" for a, b in curve.points)
        pen = f'fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"'
        body.append(f'<polyline points="{path}" {pen}/>')
        at = y(curve.points[-1][1]) + 4
        while any(abs(at - other) < 14 for other in taken):
            at += 14
        taken.append(at)
        end = x(curve.points[-1][0]) + 6
        body.append(f'<text x="{end}" y="{at}" style="fill:{colour}">{escape(curve.name)}</text>')
    centre, middle = (LEFT + WIDTH - RIGHT) / 2, (TOP + HEIGHT - BOTTOM) / 2
    body.append(f'<text x="{centre}" y="{HEIGHT - 8}" text-anchor="middle">{escape(x_name)}</text>')
    turned = f'transform="translate(18 {middle}) rotate(-90)" text-anchor="middle"'
    body.append(f"<text {turned}>{escape(y_name)}</text>")
    return _svg(HEIGHT, title, body)


def bars(title: str, unit: str, values: Sequence[tuple[str, float]]) -> str:
    """One bar per value, scaled to the largest, with its figure."""
    largest = max(value for _, value in values)
    body: list[str] = []
    left = 200
    for number, (name, value) in enumerate(values):
        top = 38 + number * (BAR + GAP)
        width = round(value / largest * (WIDTH - left - 110), 1)
        colour = COLOURS[0] if number == 0 else "#9ca3af"
        body.append(f'<text x="{left - 8}" y="{top + 13}" text-anchor="end">{escape(name)}</text>')
        body.append(f'<rect x="{left}" y="{top}" width="{width}" height="{BAR}" fill="{colour}"/>')
        body.append(f'<text x="{left + width + 6}" y="{top + 13}">{value:,.4g} {escape(unit)}</text>')
    return _svg(38 + len(values) * (BAR + GAP) + 8, title, body)
