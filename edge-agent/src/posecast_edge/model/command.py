"""`posecast-edge model build` and `posecast-edge doctor`: what they are told, what they say, how they end."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from posecast_edge.model.cache import Cache, cache_folder
from posecast_edge.model.doctor import examine
from posecast_edge.model.finding import SEVERITIES, Finding, ModelRefused, quoted
from posecast_edge.model.folder import MANIFEST, write_folder
from posecast_edge.model.progress import Bar
from posecast_edge.model.resolve import Resolver, package_folders
from posecast_edge.model.tree import build_tree
from posecast_edge.model.urdf_reader import load_urdf
from posecast_edge.profile import ProfileError, load_profile

CLEAN, PROBLEMS, UNUSABLE = 0, 1, 2
EXTRA = "needs the mesh tools: pip install 'posecast-edge[model]'"


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ModelRefused(message)


def run_command(argv: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run `model build …` or `doctor …`; the exit status."""
    parser = _Parser(prog="posecast-edge")
    commands = parser.add_subparsers(dest="command", required=True)
    model = commands.add_parser("model").add_subparsers(dest="action", required=True)
    build = model.add_parser("build", help="a URDF and its meshes, made small for phones")
    build.add_argument("urdf", type=Path)
    build.add_argument("-o", "--out", type=Path, required=True, help="the bundle's folder")
    build.add_argument("--no-cache", action="store_true", help="build it anew")
    doctor = commands.add_parser("doctor", help="what is wrong with a URDF, in plain words")
    doctor.add_argument("--urdf", type=Path, required=True)
    doctor.add_argument("--profile", type=Path, help="also whether the profile fits it")
    for command in (build, doctor):
        text = "a folder of ROS packages; may be given more than once, as may ROS_PACKAGE_PATH"
        command.add_argument("--packages", type=Path, action="append", default=[], metavar="DIR", help=text)
    file = None
    try:
        args = parser.parse_args(argv)
        file = args.urdf
        packages = [*args.packages, *package_folders(environment)]
        if args.command == "doctor":
            return _doctor(args.urdf, packages, args.profile)
        return _build(args.urdf, packages, args.out, None if args.no_cache else cache_folder(environment))
    except ModelRefused as e:
        where = "" if file is None else f"{file}: " if e.line is None else f"{file}:{e.line}: "
        _say(sys.stderr, f"posecast-edge: {where}{e.reason}")
    except ProfileError as e:
        _say(sys.stderr, f"posecast-edge: {e}")
    except OSError as e:
        _say(sys.stderr, f"posecast-edge: {e.filename or file}: {e.strerror or e}")
    return UNUSABLE


def _doctor(path: Path, packages: Sequence[Path], profile: Path | None) -> int:
    urdf = load_urdf(path)
    meaning = load_profile(profile).mapping if profile is not None else None
    try:
        from posecast_edge.model.files import Files, facts_of, read_visual_meshes  # noqa: PLC0415 - an extra
    except ImportError:
        facts = None
        _say(sys.stderr, f"posecast-edge: meshes not looked at: {EXTRA}")
    else:
        files = Files(Resolver(path, packages))
        with Bar(sys.stderr) as bar:
            read_visual_meshes(urdf, files, bar.show)
        facts = facts_of(files)
    findings = examine(urdf, build_tree(urdf), facts, meaning)
    for finding in findings:
        _say(sys.stdout, finding.words(str(path)))
    _say(sys.stdout, f"{path}: {_counted(urdf.name, len(urdf.links), len(urdf.joints), findings)}")
    return PROBLEMS if any(f.severity != "hint" for f in findings) else CLEAN


def _counted(name: str, links: int, joints: int, findings: Sequence[Finding]) -> str:
    counts = [(sum(f.severity == s for f in findings), s) for s in SEVERITIES]
    said = ", ".join(_many(n, s) for n, s in counts if n) or "nothing wrong"
    return f"robot {quoted(name)}, {_many(links, 'link')}, {_many(joints, 'joint')}: {said}"


def _many(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _build(path: Path, packages: Sequence[Path], out: Path, cache: Path | None) -> int:
    try:
        from posecast_edge.model.build import build  # noqa: PLC0415 - an extra
    except ImportError:
        raise ModelRefused(EXTRA) from None
    kept = Cache(cache, path, packages) if cache is not None else None
    files = kept.get() if kept is not None else None
    if files is None:
        resolver = Resolver(path, packages)
        with Bar(sys.stderr) as bar:
            built = build(path, resolver, bar.show)
        files = {**built.files, MANIFEST: built.manifest}
        if kept is not None:
            kept.put(files, resolver)
    write_folder(out, files)
    _report(path, out, json.loads(files[MANIFEST]))
    return CLEAN


def _report(path: Path, out: Path, manifest: Mapping[str, Any]) -> None:
    for finding in manifest.get("findings", []):
        if finding["severity"] != "hint":
            said = Finding(finding["severity"], finding["code"], finding["text"], finding.get("line"))
            _say(sys.stderr, said.words(str(path)))
    stand_ins = sum("placeholder" in v for v in manifest["visuals"])
    more = f", {_many(stand_ins, 'stand-in')} among them" if stand_ins else ""
    links, visuals = _many(len(manifest["links"]), "link"), _many(len(manifest["visuals"]), "visual")
    _say(sys.stdout, f"{out}: {links}, {visuals}{more}")
    for level in manifest["levels"]:
        size, error = f"{level['bytes'] / 1e3:,.0f} kB", f"{level['error_m'] * 1e3:.2g} mm"
        _say(sys.stdout, f"  {level['name']:7}{size:>10}{level['triangles']:>10,} triangles, within {error}")


def _say(out: Any, text: str) -> None:
    print("".join(c if c.isprintable() else "�" for c in text), file=out)
