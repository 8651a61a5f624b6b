"""Finds the file of a URI, only inside the folders that belong to the model: an untrusted URDF must not
publish other files of this machine.

Model folders: the ROS package that holds the URDF (or the URDF's own folder), packages of the requested name
beside or above it, and the user's package folders. Symbolic links are resolved before the check.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit

from posecast_edge.model.finding import ModelRefused, make_printable, quote_name
from posecast_edge.model.urdf.xml_tree import read_xml

MESHES = (".stl", ".dae", ".obj", ".glb", ".gltf", ".ply")
BESIDE = (".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp", ".gif", ".dds", ".bin")
DESCRIPTIONS = (".sdf", ".world", ".xml", ".urdf")
URI_MAX = 4096  # characters
PARTS_MAX = 32  # of a path; each may be tried as the beginning of another
LEVELS_UP = 4  # parents of the URDF's folder in which a package is looked for
FOLDERS_MAX = 2000  # looked into for a package.xml
SEARCH_PATHS = (
    "ROS_PACKAGE_PATH",
    "GAZEBO_MODEL_PATH",
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "SDF_PATH",
)
ENTRIES_MAX = 20_000  # of one folder, looked at for a name in other letters

OUTSIDE = "is outside the model's folders; give its folder with --package-path or ROS_PACKAGE_PATH"
NOWHERE = "near the robot's file; give its folder with --package-path or ROS_PACKAGE_PATH"


@dataclass(frozen=True)
class Resolved:
    """The path of a file; `hint`: how it was found if the URI was not quite right."""

    path: Path
    hint: str | None = None


def list_package_folders(environment: Mapping[str, str]) -> list[Path]:
    """The folders in which ROS looks for packages, AMENT_PREFIX_PATH/share and ROS_PACKAGE_PATH, and Gazebo
    for models."""
    ament = [Path(p, "share") for p in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    others = (p for name in SEARCH_PATHS for p in environment.get(name, "").split(os.pathsep) if p)
    return ament + [Path(p) for p in others]


def resolve_links(path: Path) -> Path:
    """The path with symbolic links resolved. A cycle of links is kept, and raises OSError when the path is
    opened."""
    return Path(os.path.realpath(path))


class Resolver:
    """Finds the files that one URDF and its meshes name."""

    def __init__(self, urdf: Path, packages: Sequence[Path] = ()) -> None:
        real = resolve_links(urdf)
        self._folder = folder = real.parent
        self._above = list(real.parents)[: LEVELS_UP + 1]
        package = next((p for p in self._above if (p / "package.xml").is_file()), None)
        beside = (folder.parent / "meshes").is_dir() and not (folder / "meshes").is_dir()
        self._root = package or (folder.parent if beside else folder)
        self._given = [resolve_links(p) for p in packages if p.is_dir()]
        self._named: dict[str, list[Path]] | None = None
        self._spellings: dict[Path, dict[str, str]] = {}  # of folders looked into
        self.asked: dict[tuple[str, str], Path | None] = {}  # (URI, "") or (mesh, name): what was found

    def find_file(self, uri: str) -> Resolved:
        """The mesh or picture that a URI of the URDF refers to. Raises ModelRefused, which says why there is
        none."""
        self.asked[uri, ""] = None
        found = self._find(uri)
        self.asked[uri, ""] = found.path
        return found

    @property
    def roots(self) -> tuple[Path, ...]:
        """The folders that belong to the model whatever is asked for: its own, and those that were given."""
        return (self._root, *self._given)

    def find_package(self, name: str) -> Path:
        """The folder of a package or model. Raises ModelRefused when there is none of that name."""
        if name in ("", ".", "..") or "/" in name or "\0" in name:
            raise ModelRefused(f"{quote_name(name)} is not a package name")
        for root in self._roots_of(name):
            return root
        raise ModelRefused(f"no package {quote_name(name)} {NOWHERE}")

    def find_description(self, uri: str) -> Path:
        """The SDF that an `<include>` names: a file, or a model's folder, whose `model.config` says which.
        Raises ModelRefused."""
        scheme, mark, rest = uri.partition("://")
        if "\0" in uri or len(uri) > URI_MAX or uri.count("/") > PARTS_MAX:
            raise ModelRefused("not a file name")
        if not mark or scheme == "file":
            path, roots = self._folder / (rest if mark else uri), list(self.roots)
        elif scheme in ("model", "package"):
            package, _, inside = unquote(rest).strip("/").partition("/")
            folder = self.find_package(package)
            path, roots = folder / inside, [folder]
        else:
            raise ModelRefused(f"{make_printable(scheme[:20])}: files are not downloaded")
        if _is_folder(path):
            path /= _configured(path / "model.config")
        return self._inside(path, roots, DESCRIPTIONS).path

    def find_beside(self, mesh: Path, name: str) -> Path:
        """A texture or material library that a mesh names, relative to the mesh. Raises ModelRefused."""
        self.asked[str(mesh), name] = None
        found = self.asked[str(mesh), name] = self._beside(mesh, name)
        return found

    def find_near(self, path: Path, suffixes: Sequence[str]) -> Path:
        """The real path of a file at an absolute path, for a format that names its files by paths. Allowed as
        for a URDF: in the model's own folder, in a package folder, or in a folder beside or above the model
        that the path names, but not loose in one that is above. Raises ModelRefused, which says why not."""
        roots = [self._root, *self._given]
        plain, home = Path(os.path.normpath(path)), Path(os.path.expanduser("~"))
        for above in self._above:
            if plain != above and plain.is_relative_to(above):
                named = above / plain.relative_to(above).parts[0]
                hidden = named.name.startswith(".") or above == above.parent
                if named != plain and not hidden and not home.is_relative_to(named) and _is_folder(named):
                    roots.append(named)
                break
        return self._inside(plain, roots, suffixes).path

    def _find(self, uri: str) -> Resolved:
        if "\0" in uri or len(uri) > URI_MAX:
            raise ModelRefused("not a file name")
        windows = "\\" in uri
        uri = uri.replace("\\", "/")
        try:
            parts = urlsplit(uri)
        except ValueError:
            raise ModelRefused("not a file name") from None
        if uri.count("/") > PARTS_MAX:
            raise ModelRefused("not a file name")
        scheme = parts.scheme if len(parts.scheme) > 1 else ""  # C:/… is a path
        path = unquote(parts.path)
        if scheme == "package":
            found = self._in_package(unquote(parts.netloc), path.strip("/"))
        elif scheme in ("file", ""):
            roots = [self._root, *self._given]
            local = Path(path) if scheme else self._folder / unquote(uri)
            seen = self._look(local, roots, MESHES + BESIDE)
            for folder in () if scheme else self._given:  # a name may also start from one of these
                if isinstance(seen, ModelRefused):
                    other = self._look(folder / unquote(uri), roots, MESHES + BESIDE)
                    seen = other if isinstance(other, Resolved) else seen
            if isinstance(seen, ModelRefused):
                raise seen
            found = seen
        elif scheme == "model":
            found = self._in_package(unquote(parts.netloc), path.strip("/"))
        else:
            raise ModelRefused(f"{scheme}: files are not downloaded")
        if windows and found.hint is None:
            return Resolved(found.path, "written with backslashes")
        return found

    def _beside(self, mesh: Path, name: str) -> Path:
        name = unquote(name.replace("\\", "/").removeprefix("file://"))
        if "\0" in name or not name or "://" in name:
            raise ModelRefused("not a file name")
        roots = [self._root, *self._given, *self._packages_of(mesh)]
        try:
            return self._inside(mesh.parent / name, roots, BESIDE).path
        except ModelRefused:
            # exporters leave the path of the artist's disk
            return self._inside(mesh.parent / PurePosixPath(name).name, roots, BESIDE).path

    # ---- packages ----

    def _in_package(self, package: str, rest: str) -> Resolved:
        if not package:  # package:///name/rest
            package, _, rest = rest.partition("/")
        if package in ("", ".", "..") or "/" in package or not rest:
            raise ModelRefused("not a file name in a package")
        refused: ModelRefused | None = None
        for root in self._roots_of(package):
            found = self._look(root / rest, [root], MESHES + BESIDE)
            if isinstance(found, Resolved):
                return found
            if found.reason == OUTSIDE:
                raise found
            refused = refused or found
        # A package whose folder was renamed or taken apart: the tail of the path in the model's own folder.
        names = PurePosixPath(rest).parts
        for i in range(len(names)):
            found = self._look(self._root.joinpath(*names[i:]), [self._root], MESHES + BESIDE)
            if isinstance(found, Resolved):
                hint = f"package {quote_name(package)} not found; taken from the model's own folder"
                return Resolved(found.path, hint)
            if found.reason == OUTSIDE:
                raise found
        raise refused or ModelRefused(f"no package {quote_name(package)} {NOWHERE}")

    def _roots_of(self, package: str) -> Iterator[Path]:
        """Folders of that package, the likeliest first."""
        home = Path(os.path.expanduser("~"))
        for folder in [*self._above, *self._given]:
            for root in (folder, folder / package):
                # a package called like the user would be all that the user has
                if root.name == package and _is_folder(root) and not home.is_relative_to(root):
                    yield resolve_links(root)
        if self._named is None:
            self._named = self._read_names()
        yield from self._named.get(package, ())

    def _read_names(self) -> dict[str, list[Path]]:
        """Package folders by the name in their package.xml: the ones above, and in the given folders."""
        named: dict[str, list[Path]] = {}
        left = FOLDERS_MAX
        candidates = list(self._above)
        for given in self._given:
            candidates.append(given)
            level = [given]
            for _ in range(2):
                level = [d for folder in level for d in _subfolders(folder)][:left]
                left -= len(level)
                candidates += level
        for folder in candidates:
            if name := _package_name(folder / "package.xml"):
                named.setdefault(name, []).append(resolve_links(folder))
        return named

    def _packages_of(self, mesh: Path) -> list[Path]:
        """The package a mesh was found in: its textures may lie in it too."""
        return [p for p in list(mesh.parents)[: LEVELS_UP + 1] if (p / "package.xml").is_file()][:1]

    # ---- files ----

    def _inside(self, path: Path, roots: Sequence[Path], suffixes: Sequence[str]) -> Resolved:
        found = self._look(path, roots, suffixes)
        if isinstance(found, ModelRefused):
            raise found
        return found

    def _look(self, path: Path, roots: Sequence[Path], suffixes: Sequence[str]) -> Resolved | ModelRefused:
        try:
            found = self._inside_of([resolve_links(root) for root in roots], path)
        except (OSError, ValueError):  # a name too long
            return ModelRefused("no such file")
        if isinstance(found, Resolved) and found.path.suffix.lower() not in suffixes:
            return ModelRefused(f"{quote_name(found.path.suffix)} is not a supported mesh or picture format")
        return found

    def _inside_of(self, roots: Sequence[Path], path: Path) -> Resolved | ModelRefused:
        plain = Path(os.path.normpath(path))
        if not any(plain.is_relative_to(root) for root in roots):
            return ModelRefused(OUTSIDE)  # without a look whether it exists
        hint = None
        if not path.exists():
            other = self._in_other_letters(plain)
            if other is None:
                return ModelRefused("no such file")
            hint = f"the file is called {quote_name(other.name)}, in other upper and lower case"
            path = other
        real = resolve_links(path)
        if not any(real.is_relative_to(root) for root in roots):
            return ModelRefused(OUTSIDE)
        return Resolved(real, hint) if real.is_file() else ModelRefused("is not a file")

    def _in_other_letters(self, path: Path) -> Path | None:
        """The same path in other upper and lower case, for what was made on Windows."""
        at = Path(path.anchor)
        for name in path.parts[1:]:
            if (at / name).exists() or name == "..":
                at /= name
                continue
            if at not in self._spellings:
                self._spellings[at] = _spellings(at)
            spelling = self._spellings[at].get(name.casefold())
            if spelling is None:
                return None
            at /= spelling
        return at


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # a name too long
        return False


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            return sorted(Path(e.path) for e in entries if e.is_dir() and not e.name.startswith("."))
    except OSError:
        return []


def _package_name(file: Path) -> str | None:
    try:
        with file.open("rb") as source:
            root = read_xml(source, bytes_max=1 << 16, elements_max=1000, depth_max=16, texts=True)
    except (OSError, ModelRefused):
        return None
    name = root.find_first("name")
    return name.text.strip() if name else None


def _configured(file: Path) -> str:
    """The name of the SDF of the newest format that a model's folder has."""
    try:
        with file.open("rb") as source:
            root = read_xml(source, bytes_max=1 << 16, elements_max=1000, depth_max=16, texts=True)
    except (OSError, ModelRefused):
        return "model.sdf"
    found = [(e.get("version") or "", e.text.strip()) for e in root.find_all("sdf") if e.text.strip()]
    return max(
        found, key=lambda one: [int(w) for w in re.findall("[0-9]{1,4}", one[0])], default=("", "model.sdf")
    )[1]


def _spellings(folder: Path) -> dict[str, str]:
    """Names in a folder, by the same without upper case; of several the first in the alphabet."""
    try:
        with os.scandir(folder) as entries:
            few = [e.name for _, e in zip(range(ENTRIES_MAX), entries, strict=False)]
    except OSError:
        return {}
    return {name.casefold(): name for name in sorted(few, reverse=True)}
