"""Where the built page lies when nobody names it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
CHECKOUT = PACKAGE.parents[2]  # when this package is installed from one
PLACES = (PACKAGE / "page", CHECKOUT / "spa/dist")  # a wheel has the page inside


def find_page(places: Sequence[Path] = PLACES) -> Path | None:
    """The folder of the built page: the one in this package, else the one that the checkout built."""
    return next((place for place in places if (place / "index.html").is_file()), None)
