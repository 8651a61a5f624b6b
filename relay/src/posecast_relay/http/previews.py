"""Link previews for chats: Open Graph in the page's head, and oEmbed for embedding.

They show only public robots. Any other robot, existing or not, gets the page's general description. A robot's
picture is the small one in its model, the manifest's `thumbnail`.

The page's own routes follow a `#`, so that one build works under any path of any host. But people type
`/r/demo`, and chats don't send the part after `#`. So the relay answers such a path with the page, and tells
it how many folders up its files are.
"""

from __future__ import annotations

import asyncio
import html
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from posecast_relay.auth.access import Access
from posecast_relay.http.robots import find_open_summary
from posecast_relay.kit import RecentDict, RefusalMemory
from posecast_relay.logging import visible
from posecast_relay.models.cache import Absent, ModelCache, ModelFile, Unavailable
from posecast_relay.models.manifest import Entry, read_thumbnail
from posecast_relay.models.picture import PICTURE_TYPES, PictureError, PictureSize, read_picture_size

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


PICTURE_BYTES_MAX = 500_000
KEPT = 1000  # cached names and sizes of pictures
LOADING_MAX = 64  # pictures loaded for previews at once; further robots have none until a place is free


class Thumbnails:
    """Finds the pictures of models. Reads each manifest once and checks each picture once."""

    def __init__(self, models: ModelCache, now: Callable[[], float] = time.monotonic) -> None:
        """`now` is a clock in seconds."""
        self._models = models
        self._now = now
        self._paths: RecentDict[str, str] = RecentDict(KEPT)  # by the model's digest
        self._checked: RecentDict[Entry, PictureSize | str] = RecentDict(KEPT)  # or why it is refused
        self._loading: dict[tuple[str, str], tuple[asyncio.Task[PictureSize], float]] = {}  # begun when
        self._away = RefusalMemory(now)  # pictures that failed to load lately, so that nobody waits for them

    async def load_picture(self, robot: str, digest: str) -> ModelFile:
        """Fetch the picture of a robot's model, unless it is kept. Raises Absent or Unavailable."""
        return (await self._load(robot, digest))[0]

    async def find_size(self, robot: str, digest: str, wait_s: float) -> PictureSize | None:
        """Return the size of a picture that can be served now; None when there is none that can.

        One that has to be fetched is waited for, `wait_s` seconds from when it was asked for first. Then it
        still comes, for who asks later.
        """
        name = robot, digest
        if self._away.find(name) is not None:
            return None
        if name not in self._loading:
            if len(self._loading) >= LOADING_MAX:
                return None
            self._loading[name] = asyncio.create_task(self._measure(*name), name="picture"), self._now()
            self._loading[name][0].add_done_callback(lambda done: self._loaded(name, done))
        task, begun_s = self._loading[name]
        # even with no time to wait, the task gets one turn: enough if the picture is cached
        await asyncio.wait({task}, timeout=max(0.0, begun_s + wait_s - self._now()))
        return task.result() if task.done() and not task.cancelled() and task.exception() is None else None

    async def _measure(self, robot: str, digest: str) -> PictureSize:
        return (await self._load(robot, digest))[1]

    def _loaded(self, name: tuple[str, str], task: asyncio.Task[PictureSize]) -> None:
        del self._loading[name]
        error = None if task.cancelled() else task.exception()
        if isinstance(error, Unavailable):
            self._away.keep(name, str(error))

    async def _load(self, robot: str, digest: str) -> tuple[ModelFile, PictureSize]:
        entries = await self._models.load_entries(robot, digest)
        entry = entries.get(self._find_path(digest))
        if entry is None or entry.type not in PICTURE_TYPES or entry.size > PICTURE_BYTES_MAX:
            raise Absent("no picture in this model")
        if isinstance(self._checked.get(entry), str):
            self._check(entry)  # from the cache, without another fetch
        found = await self._models.load_file(robot, digest, self._find_path(digest))
        return found, self._check(entry)

    def _check(self, entry: Entry) -> PictureSize:
        """Return the size of a cached picture. Raises Absent if it is not a picture, or too large."""
        size = self._checked.get(entry)
        if size is None:
            data = self._models.find_data(entry.sha256)
            if data is None:
                raise Unavailable("no memory for this model: other robots' models need it")
            try:
                size = read_picture_size(data, entry.type)
            except PictureError as e:
                size = f"the picture in this model can't be shown: {e}"
            self._checked[entry] = size
        if isinstance(size, str):
            raise Absent(size)
        return size

    def _find_path(self, digest: str) -> str:
        """Return the picture's path in a model whose manifest is cached; "" without one."""
        path = self._paths.get(digest)
        if path is None:
            path = self._paths[digest] = read_thumbnail(self._models.find_data(digest) or b"{}")
        return path


PICTURE_WAIT_S = 1.0  # wait for a picture that the robot has to send first; a chat does not ask twice
FRAME_PX = 800
FRAME_PX_MIN = 160
ASPECT = 16 / 10
CACHE_S = 3600
DESCRIPTION = "A robot's live state in your browser."
GENERAL = re.compile(r'\s*<meta property="og:[^>]*>')
OWN_PICTURE = 'property="og:image" content="./'


@dataclass(frozen=True)
class _OpenRobots:
    """The public robots of one link: their ids, their names in one line, and the first robot whose picture is
    available now, with the picture's size.
    """

    ids: str
    title: str
    pictured: tuple[str, PictureSize] | None


class LinkPreview:
    """Describes links to robots. `public_url`: the page's address without a slash at its end.

    If it is None, previews contain no absolute address: the request's `Host` header can't be trusted.
    """

    def __init__(self, access: Access, thumbnails: Thumbnails, public_url: str | None) -> None:
        self._access = access
        self._thumbnails = thumbnails
        self._public_url = public_url

    async def make_page(self, page: str, home: str, robots: tuple[str, ...] | None, is_read: bool) -> str:
        """Return the page's HTML for the folder `home`, with a preview of these robots for chats.

        `is_read`: the request comes from a browser, which need not wait for the picture.
        """
        shown = await self._find(robots, 0.0 if is_read else PICTURE_WAIT_S) if robots is not None else None
        if shown is None:
            general = page.replace(OWN_PICTURE, OWN_PICTURE.replace("./", self._get_base(home)))
            return place_page(general, home)
        title = html.escape(f"{shown.title} · Posecast")
        named = page.replace("<title>Posecast</title>", f"<title>{title}</title>", 1)
        return place_page(GENERAL.sub("", named), home, self._make_tags(shown, home))

    async def make_oembed(self, asked: str, most_px: tuple[int, int]) -> dict[str, Any] | None:
        """Return the oEmbed answer for a page's address, within this width and height.

        None if the address does not show a public robot.
        """
        base = self._public_url
        if base is None or not asked.startswith(f"{base}/"):
            return None
        path = asked[len(base) :].replace("/#/", "/", 1)
        robots = read_robots(re.split(r"[?#]", path, maxsplit=1)[0])
        one = robots is not None and len(robots) == 1
        shown = await self._find(robots, PICTURE_WAIT_S) if robots is not None and one else None
        if shown is None:
            return None
        answer = {
            "version": "1.0",
            "type": "link",
            "title": shown.title,
            "provider_name": "Posecast",
            "provider_url": f"{base}/",
            "cache_age": CACHE_S,
        }
        if shown.pictured is not None:
            robot, size = shown.pictured
            answer |= {
                "thumbnail_url": f"{base}/api/v1/robots/{robot}/picture",
                "thumbnail_width": size.width_px,
                "thumbnail_height": size.height_px,
            }
        if tuple(self._access.list_frame_ancestors(shown.ids)) == ("*",):
            answer |= self._make_frame(shown, most_px)
        return answer

    def _make_frame(self, shown: _OpenRobots, most_px: tuple[int, int]) -> dict[str, Any]:
        width = max(FRAME_PX_MIN, min(FRAME_PX, most_px[0], round(most_px[1] * ASPECT)))
        height = round(width / ASPECT)
        frame = (
            f'<iframe src="{self._public_url}/embed/{shown.ids}" width="{width}" height="{height}" '
            f'title="{html.escape(shown.title)}" style="border: 0" allow="fullscreen" loading="lazy">'
            "</iframe>"
        )
        return {"type": "rich", "width": width, "height": height, "html": frame}

    def _make_tags(self, shown: _OpenRobots, home: str) -> str:
        base = self._get_base(home)
        title = shown.title
        told = {
            "og:site_name": "Posecast",
            "og:type": "website",
            "og:title": title,
            "og:description": DESCRIPTION,
            "og:image": f"{base}icon-512.png",
        }
        if shown.pictured is not None:
            robot, size = shown.pictured
            told |= {
                "og:image": f"{base}api/v1/robots/{robot}/picture",
                "og:image:width": str(size.width_px),
                "og:image:height": str(size.height_px),
                "og:image:alt": title,
            }
        if self._public_url is not None:
            told["og:url"] = address = f"{base}r/{shown.ids}"
        tags = [
            f'<meta property="{name}" content="{html.escape(text)}" />\n    ' for name, text in told.items()
        ]
        tags.append('<meta name="twitter:card" content="summary" />\n  ')
        if self._public_url is not None and "+" not in shown.ids:
            asked = f"{base}api/v1/oembed?url={quote(address, safe='')}"
            tags.insert(0, f'<link rel="alternate" type="application/json+oembed" href="{asked}" />\n    ')
        return "".join(tags)

    def _get_base(self, home: str) -> str:
        return home if self._public_url is None else f"{self._public_url}/"

    async def _find(self, robots: tuple[str, ...], wait_s: float) -> _OpenRobots | None:
        """Return these robots as anyone sees them; None if one of them is not public."""
        summaries = [find_open_summary(self._access, robot) for robot in robots]
        found = [summary for summary in summaries if summary is not None]
        if len(found) < len(robots):
            return None
        names = [visible(str(summary["name"])) for summary in found]
        models = {str(summary["robot"]): str(summary["model"]) for summary in found if summary.get("model")}
        sizes = await asyncio.gather(
            *(self._thumbnails.find_size(robot, model, wait_s) for robot, model in models.items())
        )
        pictured = ((robot, size) for robot, size in zip(models, sizes, strict=True) if size is not None)
        return _OpenRobots("+".join(robots), ", ".join(names), next(pictured, None))
