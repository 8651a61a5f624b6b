"""Makes link previews for chats: Open Graph in the page's head, and oEmbed for embedding.

They show only public robots. Any other robot, existing or not, gets the page's general description.
"""

from __future__ import annotations

import asyncio
import html
import re
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from posecast_wire.checked import SCRIPT_MARKS

from posecast_relay.auth.access import Access
from posecast_relay.http.page_address import place_page, read_robots
from posecast_relay.http.robots import find_open_summary
from posecast_relay.http.thumbnails import Thumbnails
from posecast_relay.logging import visible
from posecast_relay.models.picture import PictureSize

PICTURE_WAIT_S = 1.0  # wait for a picture that the robot has to send first; a chat does not ask twice
FRAME_PX = 800
FRAME_PX_MIN = 160
ASPECT = 16 / 10
CACHE_S = 3600
SAID = "A robot's live state in your browser."
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
            "og:description": SAID,
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
        names = [visible(str(summary["name"]), kept=SCRIPT_MARKS) for summary in found]
        models = {str(summary["robot"]): str(summary["model"]) for summary in found if summary.get("model")}
        sizes = await asyncio.gather(
            *(self._thumbnails.find_size(robot, model, wait_s) for robot, model in models.items())
        )
        pictured = ((robot, size) for robot, size in zip(models, sizes, strict=True) if size is not None)
        return _OpenRobots("+".join(robots), ", ".join(names), next(pictured, None))
