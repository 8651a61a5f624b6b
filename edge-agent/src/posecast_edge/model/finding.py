"""What is wrong with a model, in plain words: one finding, one line."""

from __future__ import annotations

from dataclasses import dataclass

EXTRA = "pip install 'posecast-edge[model]'"
SEVERITIES = ("error", "warning", "hint")


class ModelRefused(Exception):
    """A model or a file of it that cannot be used: one line, without the file's name."""

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.line = line


@dataclass(frozen=True)
class Finding:
    """`severity` is `error` (something is not shown, or wrong), `warning` (probably wrong) or `hint`; `code`
    names the rule for tools; `line` is the URDF's, None when it has none."""

    severity: str
    code: str
    text: str
    line: int | None = None

    def format_line(self, file: str) -> str:
        """`robot.urdf:12: error: text [code]`, the form editors and CI understand."""
        where = file if self.line is None else f"{file}:{self.line}"
        return f"{where}: {self.severity}: {self.text} [{self.code}]"


def sort_by_severity(findings: list[Finding]) -> list[Finding]:
    """By severity, then line; each only once."""
    unique = list(dict.fromkeys(findings))
    return sorted(unique, key=lambda f: (SEVERITIES.index(f.severity), f.line or 0, f.code, f.text))


def quote_name(name: str, longest: int = 80) -> str:
    """A name from a stranger's file, safe to print: no control characters, not endless."""
    shown = make_printable(name[: longest + 1])
    return f"'{shown}'" if len(shown) <= longest else f"'{shown[:longest]}…'"


def make_printable(text: str) -> str:
    """The same with a sign of its own for what moves the cursor, ends a line or turns the writing round."""
    return "".join(c if c.isprintable() else "�" for c in text)
