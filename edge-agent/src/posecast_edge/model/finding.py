"""A finding: one problem of a model, as one line of text."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from posecast_wire.command_line.installation import advise_extra

NO_BALANCE = "no balance is shown"  # the consequence of impossible or unknown masses
SEVERITIES = ("error", "warning", "hint")


def advise_mesh_tools() -> str:
    """The command that installs the mesh tools, which build models."""
    return advise_extra("posecast-edge", "model")


def has_simplifier() -> bool:
    """Whether meshoptimizer is installed; without it, models are coarser and larger."""
    return importlib.util.find_spec("meshoptimizer") is not None


def explain_coarser() -> str | None:
    """One line that says why models are coarser on this machine; None if they are not."""
    if has_simplifier():
        return None
    advice = advise_extra("posecast-edge", "meshopt")
    return f"built without meshoptimizer, so it is coarser; if you have a C++ compiler: {advice}"


class ModelRefused(Exception):
    """A model or one of its files can't be used. The message is one line, without the file's name."""

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.line = line


@dataclass(frozen=True)
class Finding:
    """`severity`: `error` (something is wrong or not shown), `warning` (probably wrong) or `hint`; `code`:
    the rule's name, for tools; `line`: in the URDF, None or 0 without one."""

    severity: str
    code: str
    text: str
    line: int | None = None

    def format_line(self, file: str) -> str:
        """The form that editors and CI understand: `robot.urdf:12: error: text [code]`."""
        where = f"{file}:{self.line}" if self.line else file
        return f"{where}: {self.severity}: {self.text} [{self.code}]"


@contextmanager
def distrust_masses(findings: list[Finding]) -> Iterator[None]:
    """Turn the findings about invalid numbers that are added inside, all in one link's mass, centre and
    moments, into reasons to show no balance."""
    since = len(findings)
    try:
        yield
    finally:
        for i in range(since, len(findings)):
            found = findings[i]
            if found.code == "number":
                findings[i] = replace(found, code="mass-number", text=f"{found.text}; {NO_BALANCE}")


def sort_by_severity(findings: list[Finding]) -> list[Finding]:
    """Sort findings by severity, then line, and remove duplicates."""
    unique = list(dict.fromkeys(findings))
    return sorted(unique, key=lambda f: (SEVERITIES.index(f.severity), f.line or 0, f.code, f.text))


def quote_name(name: str, longest: int = 80) -> str:
    """Quote a name from an untrusted file so that it is safe to print: no control characters, bounded
    length."""
    shown = make_printable(name[: longest + 1])
    return f"'{shown}'" if len(shown) <= longest else f"'{shown[:longest]}…'"


def quote_names(names: Sequence[str], shown: int = 6) -> str:
    """The first names, quoted for one line, and how many more there are."""
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(map(quote_name, names[:shown])) + more


def make_printable(text: str) -> str:
    """Replace characters that move the cursor, end a line or change the writing direction."""
    return "".join(c if c.isprintable() else "�" for c in text)
