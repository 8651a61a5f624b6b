"""Reports whether a running relay's configuration files are valid."""

from __future__ import annotations

from collections.abc import Mapping

from posecast_relay.config.robots_watcher import RobotsWatcher
from posecast_relay.zenoh.router import RouterSession


class Configuration:
    """The configuration files that one process watches, and their problems. Its methods are thread-safe."""

    def __init__(self, watch: RobotsWatcher | None, router: RouterSession | None) -> None:
        """`watch`: None without a robots file; `router`: None if no robots connect to this process."""
        self._watch, self._router = watch, router

    def find_trouble(self) -> str | None:
        """Return which files can't be used; None if all are valid. It is public, so it names no robot."""
        return (
            "; ".join(
                f"the {what} file can't be used, so its last good version stays in force; the log says why"
                for what, is_good in self.measure().items()
                if not is_good
            )
            or None
        )

    def measure(self) -> dict[str, int]:
        """Return 1 for each kind of file that is valid, 0 for one that is not."""
        if self._watch is None:
            return {}
        found = {"robots": int(self._watch.trouble is None)}
        if self._router is not None:
            found["certificates"] = int(self._router.trouble is None)
        return found

    def find_expiries(self) -> Mapping[str, float]:
        """Return when the certificates in use expire, in unix seconds, by the flag that names the file."""
        return {} if self._router is None else self._router.expiries_s
