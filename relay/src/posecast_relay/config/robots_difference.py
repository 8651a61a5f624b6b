"""Says which credentials differ between two versions of the file of `--robots`. Does no I/O."""

from __future__ import annotations

from posecast_relay.config.robots_reader import RobotEntry, Robots


def list_credential_changes(before: Robots, after: Robots) -> list[str]:
    """Return a line for each robot, credential, key of share links and credential of `/admin` that another
    version of the file would remove, bring back or replace. Rules of who may watch don't count. The lines
    hold no secret.
    """
    lines: list[str] = []
    for name in sorted(before.enrolled.keys() | after.enrolled.keys()):
        old, new = before.enrolled.get(name), after.enrolled.get(name)
        if old is None:
            lines.append(f"{name}: is added, perhaps back again: it may publish")
        elif new is None:
            lines.append(f"{name}: is removed: its credential and its share links are worth nothing")
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
        changes.append("may publish for longer (`expires`)")
    return changes


def _describe_change(what: str, before: str | None, after: str | None) -> str:
    if after is None:
        return f"has no {what} any more"
    if before is None:
        return f"has a {what}, perhaps an old one; it had none before this change"
    return f"has another {what}, perhaps an older one; the one before this change is worth nothing"
