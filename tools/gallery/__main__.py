"""Builds every robot in some folders, one after another, and shows the result of each.

python -m tools.gallery [--out gallery] [FOLDER …]: writes table.csv, findings.txt and contact sheets. Without
folders it searches the installed robot packages and shared/robots.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from posecast_edge.model.robot_file import find_format

from tools.gallery.child import run_measured
from tools.gallery.files import PACKAGES, SHARED, RobotPath, find_robots, list_packages

PART_WORDS = ("it is a part", "macros and no link")  # of a refusal
ENDS = {0: "built", 1: "stand-ins", 2: "refused"}
NAMED = 5  # of the largest in the summary


@dataclass
class Row:
    """One robot in the table. `status`: built, stand-ins (nothing else can be shown), refused, part (other
    files include it), stopped (at the time limit) or crashed; `worst_mm`: the largest distance between a link
    and its position in Pinocchio or MuJoCo; `line`: why it was refused, or why nothing was compared."""

    name: str
    format: str
    status: str
    wall_s: float
    cpu_s: float
    rss_mb: float
    links: int = 0
    joints: int = 0
    visuals: int = 0
    stand_ins: int = 0
    errors: int = 0
    warnings: int = 0
    hints: int = 0
    worst_mm: str = ""
    compared: int = 0
    line: str = ""


def build_robot(robot: RobotPath, picture: Path, findings: list[str]) -> Row:
    """Build one robot, draw it into `picture`, and add its findings' lines to `findings`."""
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / "bundle"
        build = ("-m", "posecast_edge", "model", "build", "--no-cache", str(robot.path), "-o", str(bundle))
        ended = run_measured([sys.executable, *build])
        status = "stopped" if ended.status is None else ENDS.get(ended.status, "crashed")
        row = Row(
            robot.name,
            find_format(robot.path),
            status,
            round(ended.wall_s, 1),
            round(ended.cpu_s, 1),
            round(ended.rss_mb, 1),
        )
        if not (bundle / "manifest.json").is_file():
            lines = ended.err.strip().splitlines() or [f"ended with status {ended.status}"]
            row.line = lines[-1].removeprefix("posecast-edge: ").removeprefix(f"{robot.path}:").strip()
            if status == "refused" and (robot.is_included or any(w in row.line for w in PART_WORDS)):
                row.status = "part"
            return row
        manifest = json.loads((bundle / "manifest.json").read_text())
        row.links, row.joints = len(manifest["links"]), len(manifest["joints"])
        row.visuals = len(manifest["visuals"])
        row.stand_ins = sum("placeholder" in v for v in manifest["visuals"])
        severities = Counter(f["severity"] for f in manifest.get("findings", []))
        row.errors, row.warnings, row.hints = (severities[s] for s in ("error", "warning", "hint"))
        findings += [
            f"{f['severity']}\t{f['code']}\t{robot.name}:{f.get('line', '')}\t{f['text']}"
            for f in manifest.get("findings", [])
        ]
        look = ("-m", "tools.gallery.look", str(robot.path), str(bundle), str(picture))
        seen = run_measured([sys.executable, *look])
        if seen.status != 0:
            row.line = f"not looked at: {(seen.err.strip().splitlines() or [str(seen.status)])[-1]}"
            return row
        said = json.loads(seen.out.splitlines()[-1])
        row.line = said["why"]
        if "worst_mm" in said:
            row.worst_mm, row.compared = f"{said['worst_mm']:.4f}", said["compared"]
    return row


def summarise(rows: Sequence[Row]) -> list[str]:
    """The table in a few lines."""
    counts = Counter(row.status for row in rows)
    lines = [f"{len(rows)} files: " + ", ".join(f"{n} {status}" for status, n in counts.most_common())]
    for what, unit in (("cpu_s", "s of CPU"), ("rss_mb", "MB")):
        largest = sorted(rows, key=lambda row: -float(getattr(row, what)))[:NAMED]
        lines.append(f"most {unit}: " + ", ".join(f"{getattr(r, what)} {r.name}" for r in largest))
    compared = sorted((row for row in rows if row.worst_mm), key=lambda row: -float(row.worst_mm))
    if compared:
        shown = ", ".join(f"{row.worst_mm} {row.name}" for row in compared[:NAMED])
        lines.append(f"links compared in {len(compared)}; farthest, in mm: {shown}")
    others = Counter(row.line for row in rows if row.visuals and row.line)
    lines += [f"{n} not compared: {why}" for why, n in others.most_common()]
    lines += [
        f"{row.status}: {row.name}: {row.line}"
        for row in rows
        if row.status in ("refused", "stopped", "crashed")
    ]
    return lines


def main(arguments: Sequence[str]) -> int:
    """Run the gallery. Returns the exit status: 1 if no robot was found."""
    parser = argparse.ArgumentParser(prog="python -m tools.gallery", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("gallery"), help="output folder (gallery)")
    parser.add_argument("folders", type=Path, nargs="*", help="folders to search (installed packages)")
    args = parser.parse_args(arguments)
    places = args.folders or list_packages()
    robots = find_robots(places)
    if not robots:
        looked = ", ".join(map(str, places)) or f"no {', '.join(PACKAGES)} installed, no {SHARED}"
        print(f"gallery: no robot found ({looked}); pass folders: make gallery FOLDERS=…", file=sys.stderr)
        return 1
    os.nice(10)
    pictures = args.out / "robots"
    pictures.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    findings: list[str] = []
    shown: list[tuple[str, str | None, str]] = []
    for number, robot in enumerate(robots):
        picture = pictures / f"{number:03}.png"
        picture.unlink(missing_ok=True)
        rows.append(row := build_robot(robot, picture, findings))
        if row.status != "part":
            drawn = str(picture) if picture.is_file() else None
            shown.append((row.name, drawn, f"{row.status}: {row.line}"))
        print(
            f"{number + 1}/{len(robots)} {row.status}, {row.cpu_s} s, {row.rss_mb} MB: {row.name}", flush=True
        )
        _write_table(rows, args.out / "table.csv")  # complete after each robot, in case it is stopped
    (args.out / "findings.txt").write_text("".join(f"{line}\n" for line in sorted(findings)))
    (args.out / "shown.json").write_text(json.dumps(shown))
    # in a separate process, because this one must stay small (child.py)
    made = run_measured([sys.executable, "-m", "tools.gallery.sheets", str(args.out)])
    if made.status != 0:
        print(made.err, file=sys.stderr)
        return 1
    summary = summarise(rows)
    (args.out / "summary.txt").write_text("".join(f"{line}\n" for line in summary))
    print("\n".join(summary))
    return 0


def _write_table(rows: Sequence[Row], path: Path) -> None:
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow([field.name for field in fields(Row)])
        table.writerows(astuple(row) for row in rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
