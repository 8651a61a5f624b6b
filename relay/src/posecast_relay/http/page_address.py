"""What a path without `#` names on the page, and the page as it is served there.

The page's own routes stand behind `#`, so that one build works under any path of any host. A person types
`/r/demo`, and a chat that shows a link asks for nothing behind `#`: so the relay answers such a path by the
page itself, told how many folders above its files are.
"""

from __future__ import annotations

import re

SIDE_BY_SIDE_MAX = 6  # as in the page's own routes (spa/src/app/state/route.ts)
LEVELS_MAX = 16  # a path that lies deeper was typed by nobody
NAME = r"[a-z0-9][a-z0-9-]{0,62}"
ROBOTS = re.compile(rf"/r/(?P<robots>{NAME}(?:\+{NAME}){{0,{SIDE_BY_SIDE_MAX - 1}}})/?")
OF_THE_PAGE = re.compile(r'(?P<name>\b(?:href|src))="\./')


def read_robots(path: str) -> tuple[str, ...] | None:
    """Return the robots that `/r/ROBOT` or `/r/ROBOT+ROBOT` names; None for any other path."""
    found = ROBOTS.fullmatch(path)
    return None if found is None else tuple(dict.fromkeys(found["robots"].split("+")))


def find_home(path: str) -> str | None:
    """Return how a browser at this path, as it stands in the request, names the folder of the page.

    None when the path is too deep.
    """
    levels = path.count("/") - 1
    return None if levels > LEVELS_MAX else "../" * levels or "./"


def place_page(page: str, home: str, more: str = "") -> str:
    """Return the page's HTML as it has to be where its files are in the folder `home`.

    `more` is HTML for its head.
    """
    placed = OF_THE_PAGE.sub(rf'\g<name>="{home}', page)
    placed = placed.replace("<html ", f'<html data-home="{home}" ', 1)
    return placed.replace("</head>", f"{more}</head>", 1)
