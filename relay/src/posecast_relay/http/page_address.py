"""Serves the page under paths without `#`, such as `/r/demo`.

The page's own routes follow a `#`, so that one build works under any path of any host. But people type
`/r/demo`, and chats don't send the part after `#`. So the relay answers such a path with the page, and tells
it how many folders up its files are.
"""

from __future__ import annotations

import re

SIDE_BY_SIDE_MAX = 6  # as in the page's own routes (spa/src/app/state/route.ts)
LEVELS_MAX = 16  # nobody types a deeper path
NAME = r"[a-z0-9][a-z0-9-]{0,62}"
ROBOTS = re.compile(rf"/r/(?P<robots>{NAME}(?:\+{NAME}){{0,{SIDE_BY_SIDE_MAX - 1}}})/?")
OF_THE_PAGE = re.compile(r'(?P<name>\b(?:href|src))="\./')


def read_robots(path: str) -> tuple[str, ...] | None:
    """Return the robots that `/r/ROBOT` or `/r/ROBOT+ROBOT` names; None for any other path."""
    found = ROBOTS.fullmatch(path)
    return None if found is None else tuple(dict.fromkeys(found["robots"].split("+")))


def find_home(path: str) -> str | None:
    """Return the relative URL of the page's folder for a browser at this request path.

    None if the path is too deep.
    """
    levels = path.count("/") - 1
    return None if levels > LEVELS_MAX else "../" * levels or "./"


def place_page(page: str, home: str, more: str = "") -> str:
    """Return the page's HTML, adapted to files in the folder `home`.

    `more` is HTML for its head.
    """
    placed = OF_THE_PAGE.sub(rf'\g<name>="{home}', page)
    placed = placed.replace("<html ", f'<html data-home="{home}" ', 1)
    return placed.replace("</head>", f"{more}</head>", 1)
