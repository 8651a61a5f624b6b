"""The log on stderr: lines for people on a terminal, JSON lines for whatever collects them elsewhere."""

from __future__ import annotations

import json
import logging
import sys
from datetime import UTC, datetime

MEMBERS = ("conn", "robot", "code", "reason")  # beside ts, level and event; nothing else a viewer sent


class JsonLines(logging.Formatter):
    """`{"ts": …, "level": …, "event": …}` and what is known of the connection."""

    def format(self, record: logging.LogRecord) -> str:
        """One line, whatever is in it."""
        doc: dict[str, object] = {
            "ts": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "event": record.getMessage(),
        }
        doc |= {name: getattr(record, name) for name in MEMBERS if hasattr(record, name)}
        if record.exc_info:
            doc["exception"] = self.formatException(record.exc_info)
        return json.dumps(doc, ensure_ascii=False)


class _Plain(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        known = " ".join(f"{name}={getattr(record, name)}" for name in MEMBERS if hasattr(record, name))
        return f"{super().format(record)} {known}".rstrip()


def start_logging(level: str) -> None:
    """To stderr, from `level` on."""
    handler = logging.StreamHandler(sys.stderr)
    plain = _Plain("%(asctime)s %(levelname)s %(name)s: %(message)s")
    handler.setFormatter(plain if sys.stderr.isatty() else JsonLines())
    logging.basicConfig(level=level.upper(), handlers=[handler])
