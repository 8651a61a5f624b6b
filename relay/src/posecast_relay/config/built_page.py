"""Finds the built page when `--static` is not given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
CHECKOUT = PACKAGE.parents[2]  # if this package is installed from a checkout
PLACES = (PACKAGE / "page", CHECKOUT / "spa/dist")  # a wheel contains the page


def find_page(places: Sequence[Path] = PLACES) -> Path | None:
    """Return the folder of the built page: in this package, else in the checkout; None without either."""
    return next((place for place in places if (place / "index.html").is_file()), None)
