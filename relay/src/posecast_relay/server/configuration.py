"""Reports whether a running relay's configuration files are valid and in force."""

from __future__ import annotations

from collections.abc import Mapping

from posecast_relay.config.robots_file import RobotsWatcher
from posecast_relay.zenoh.router import RouterSession


class Configuration:
    """The configuration files that one process watches, and their problems. Its methods are thread-safe."""

    def __init__(self, watch: RobotsWatcher | None, router: RouterSession | None) -> None:
        """`watch`: None without a robots file; `router`: None if no robots connect to this process."""
        self._watch, self._router = watch, router

    def find_trouble(self) -> str | None:
        """Return why robots can't connect, and which files can't be used; None if all is well. It is public,
        so it names no robot.
        """
        found = [
            f"the {what} file can't be used, so its last good version stays in force; the log says why"
            for what, of in (("robots", self._watch), ("certificates", self._router))
            if of is not None and of.trouble is not None
        ]
        if not self.is_listening():
            found.append(
                "robots can't connect, because their port can't be opened; retrying; the log says why"
            )
        elif self._watch is not None and self._watch.failure is not None:
            found.append("a change of the robots or certificates is not in force; retrying; the log says why")
        return "; ".join(found) or None

    def measure(self) -> dict[str, int]:
        """Return 1 for each kind of file that is valid and in force, 0 for one that is not."""
        if self._watch is None:
            return {}
        # without a port for robots, nobody publishes by the previous version: `is_listening` reports that
        is_in_force = self._watch.failure is None or not self.is_listening()
        found = {"robots": int(self._watch.trouble is None and is_in_force)}
        if self._router is not None:
            found["certificates"] = int(self._router.trouble is None)
        return found

    def is_listening(self) -> bool:
        """Return whether robots can connect. A process to which none connect returns True."""
        return self._router is None or self._router.is_listening

    def find_expiries(self) -> Mapping[str, float]:
        """Return when the certificates in use expire, in unix seconds, by the flag that names the file."""
        return {} if self._router is None else self._router.expiries_s
