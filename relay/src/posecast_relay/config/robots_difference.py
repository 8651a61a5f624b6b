"""Lists the credentials that differ between two versions of the robots file. Does no I/O."""

from __future__ import annotations

from posecast_relay.config.robots_reader import RobotEntry, Robots


def list_credential_changes(before: Robots, after: Robots) -> list[str]:
    """Return a line for each robot, credential, key of share links and credential of `/admin` that the new
    version of the file removes, restores or replaces. Rules about viewers are ignored. The lines contain no
    secrets.
    """
    lines: list[str] = []
    for name in sorted(before.enrolled.keys() | after.enrolled.keys()):
        old, new = before.enrolled.get(name), after.enrolled.get(name)
        if old is None:
            lines.append(f"{name}: added, or restored after its removal: it can publish")
        elif new is None:
            lines.append(f"{name}: removed: its credential and its share links stop working")
        else:
            lines += (f"{name}: {change}" for change in _list_changes(old, new))
    admin_before, admin_after = (each.admin.secret if each.admin else None for each in (before, after))
    if admin_before != admin_after:
        lines.append(f"/admin: {_describe_change('credential', admin_before, admin_after)}")
    return lines


def _list_changes(old: RobotEntry, new: RobotEntry) -> list[str]:
    changes = [
        _describe_change(what, before, after)
        for what, before, after in (
            ("credential", old.secret, new.secret),
            ("next credential (`rotate --begin`)", old.next_secret, new.next_secret),
            ("key of its share links", old.link_key, new.link_key),
        )
        if before != after
    ]
    if new.expires_s > old.expires_s:
        changes.append("can publish for longer (`expires`)")
    return changes


def _describe_change(what: str, before: str | None, after: str | None) -> str:
    if after is None:
        return f"loses its {what}"
    if before is None:
        return f"gets a {what}, possibly an old one; it had none before"
    return f"gets a different {what}, possibly an older one; the previous one stops working"
