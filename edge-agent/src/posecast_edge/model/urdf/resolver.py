"""Finds the file of a URI, only inside the folders that belong to the model: an untrusted model must not
publish other files of this machine.

`Resolver.check` is the one rule, for every format and on the path with its symbolic links resolved. These
folders belong to a model: its own, packages beside and above it, and the folders that the user gives. A
package is recognised by its `package.xml` or `model.config`, never by its folder's name alone.
"""

from __future__ import annotations

import contextlib
import errno
import os
import pwd
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO
from urllib.parse import unquote, urlsplit

from posecast_edge.model.finding import ModelRefused, make_printable, quote_name
from posecast_edge.model.urdf.xml_tree import Element, read_xml

MESHES = (".stl", ".dae", ".obj", ".glb", ".gltf", ".ply")
BESIDE = (".mtl", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp", ".gif", ".dds", ".bin")
DESCRIPTIONS = (".sdf", ".world", ".xml", ".urdf")
URI_MAX = 4096  # characters
PARTS_MAX = 32  # of a path; each may be tried as the beginning of another
LEVELS_UP = 4  # parents of the URDF's folder in which a package is looked for
MARKERS = ("package.xml", "model.config")  # files of ROS and Gazebo that make their folder a package
# what may lie beside the folder of a model without a package, as in NAME/urdf and NAME/meshes
MESH_FOLDERS = ("meshes", "mesh", "stl", "stls", "dae", "textures", "materials")
FOLDERS_MAX = 2000  # looked into for a package.xml
SEARCH_PATHS = (
    "ROS_PACKAGE_PATH",
    "GAZEBO_MODEL_PATH",
    "GZ_SIM_RESOURCE_PATH",
    "IGN_GAZEBO_RESOURCE_PATH",
    "SDF_PATH",
)
ENTRIES_MAX = 20_000  # of one folder, looked at for a name in other letters
# folders in which files of every kind lie together: of any desktop, of all users, and the roots of disks
DESKTOP = ("Desktop", "Documents", "Downloads", "Music", "Pictures", "Public", "Templates", "Videos")
TEMPORARY = ("/tmp", "/var/tmp", "/dev/shm")
EVERYTHING = re.compile(
    r"/(?:bin|boot|dev|etc|lib|media|mnt|opt|proc|root|run|srv|sys|usr|var)|(?:/run)?/media/[^/]+(?:/[^/]+)?"
    rf"|(?:/mnt/[a-z])?(?:/(?:home|Users)(?:/[^/]+)?)?|.*/(?:{'|'.join(DESKTOP)})"
)
DESKTOP_ENTRY = re.compile(r'^XDG_[A-Z]+_DIR="\$HOME/([^"\n]{1,255})"', re.MULTILINE)

ADVICE = "give its folder with --package-path or ROS_PACKAGE_PATH"
OUTSIDE = f"is outside the model's folders; {ADVICE}"
HIDDEN = f"has a name on its path that begins with a dot; {ADVICE}"
SHARED = (
    "lies in a folder for files of every kind (the home folder, Downloads, /tmp, a disk), as the robot's "
    f"file does; move the robot to a folder of its own, or {ADVICE}"
)
REFUSALS = frozenset((OUTSIDE, HIDDEN, SHARED))
NOWHERE = f"with a package.xml or model.config near the robot's file; {ADVICE}"


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


def list_shared_folders(environment: Mapping[str, str]) -> list[Path]:
    """The folders in which files of every kind lie together, which so belong to no model: the home folder, a
    desktop's folders such as Downloads, and those for temporary files."""
    homes = [environment.get("HOME", "")]
    with contextlib.suppress(KeyError):  # a user without an entry, as in a container
        homes.append(pwd.getpwuid(os.getuid()).pw_dir)  # another one under sudo, and in a service
    shared = [Path(folder) for folder in TEMPORARY]
    for home in (Path(folder) for folder in homes if os.path.isabs(folder)):
        try:
            entries = DESKTOP_ENTRY.findall((home / ".config/user-dirs.dirs").read_text("utf-8"))
        except (OSError, ValueError):
            entries = []
        shared += [home, *(home / name for name in (*DESKTOP, *entries))]
    return [resolve_links(folder) for folder in dict.fromkeys(shared)]


def resolve_links(path: Path) -> Path:
    """The path with symbolic links resolved. A cycle of links is kept, and raises OSError when the path is
    opened."""
    return Path(os.path.realpath(path))


def open_file(path: Path) -> BinaryIO:
    """Open a file for reading. Raises OSError, also for what is no file: a pipe would wait for its writer."""
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.EINVAL, "is not a file", str(path))
    return os.fdopen(file, "rb")


def read_bounded(path: Path, most: int) -> bytes:
    """Read a file. Raises ModelRefused when it is larger than `most` bytes or can't be read."""
    try:
        if path.stat().st_size > most:
            raise ModelRefused(f"over {most >> 20} MiB")
        with open_file(path) as file:
            data = file.read(most + 1)
    except OSError as e:
        raise ModelRefused(e.strerror or "can't be read") from None
    if len(data) > most:
        raise ModelRefused(f"over {most >> 20} MiB")
    return data


class Resolver:
    """Finds the files that one model and its meshes name."""

    def __init__(
        self, urdf: Path, packages: Sequence[Path] = (), shared: Sequence[Path] | None = None
    ) -> None:
        """`shared`: folders that belong to no model; None for those that list_shared_folders finds."""
        self._shared = list_shared_folders(os.environ) if shared is None else shared
        self._folder = resolve_links(urdf).parent
        self._above = [self._folder, *self._folder.parents][: LEVELS_UP + 1]
        self._given = [resolve_links(p) for p in packages if p.is_dir()]
        self._own = self._list_own()
        self._packages: dict[Path, None] = {}  # that were asked for by name, wherever links led
        self._named: dict[str, list[Path]] | None = None
        self._spellings: dict[Path, dict[str, str]] = {}  # of folders looked into
        self.asked: dict[tuple[str, str], Path | None] = {}  # (URI, "") or (mesh, name): what was found

    def check(self, path: Path) -> Path:
        """The real path of an absolute path, which may be read if there is something. Raises ModelRefused,
        which says why, when it does not belong to the model. Every file of every format passes here."""
        plain = Path(os.path.normpath(path))
        roots = [*self.roots, *self._packages]
        if not _is_inside(plain, roots):
            roots += self._list_packages_around(plain)
        self._require_inside(plain, roots)  # what is outside is not even looked for
        real = resolve_links(path)
        self._require_inside(real, roots)
        return real

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
        return (*self._own, *self._given)

    def find_package(self, name: str) -> Path:
        """The folder of a package or model. Raises ModelRefused when there is none of that name."""
        if name in ("", ".", "..") or "/" in name or "\0" in name:
            raise ModelRefused(f"{quote_name(name)} is not a package name")
        for folder in self._folders_of(name):
            return folder
        raise ModelRefused(f"no package {quote_name(name)} {NOWHERE}")

    def find_description(self, uri: str) -> Path:
        """The SDF that an `<include>` names: a file, or a model's folder, whose `model.config` says which.
        Raises ModelRefused."""
        scheme, mark, rest = uri.partition("://")
        if "\0" in unquote(uri) or len(uri) > URI_MAX or uri.count("/") > PARTS_MAX:
            raise ModelRefused("not a file name")
        if not mark or scheme == "file":
            path = self._folder / (rest if mark else uri)
        elif scheme in ("model", "package"):
            package, _, inside = unquote(rest).strip("/").partition("/")
            path = self.find_package(package) / inside
        else:
            raise ModelRefused(f"{make_printable(scheme[:20])}: files are not downloaded")
        if os.path.isdir(folder := self.check(path)):
            path = folder / _configured(self.check(folder / "model.config"))
        return self._inside(path, DESCRIPTIONS).path

    def find_beside(self, mesh: Path, name: str) -> Path:
        """A texture or material library that a mesh names, relative to the mesh. Raises ModelRefused."""
        self.asked[str(mesh), name] = None
        found = self.asked[str(mesh), name] = self._beside(mesh, name)
        return found

    def find_at(self, path: Path, suffixes: Sequence[str]) -> Path:
        """The real path of a file at an absolute path, for a format that names its files by paths. Raises
        ModelRefused, which says why there is none."""
        return self._inside(Path(os.path.normpath(path)), suffixes).path

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
        if scheme in ("package", "model"):
            found = self._in_package(unquote(parts.netloc), path.strip("/"))
        elif scheme in ("file", ""):
            local = Path(path) if scheme else self._folder / unquote(uri)
            seen = self._look(local, MESHES + BESIDE)
            for folder in () if scheme else self._given:  # a name may also start from one of these
                if isinstance(seen, ModelRefused):
                    other = self._look(folder / unquote(uri), MESHES + BESIDE)
                    seen = other if isinstance(other, Resolved) else seen
            if isinstance(seen, ModelRefused):
                raise seen
            found = seen
        else:
            raise ModelRefused(f"{scheme}: files are not downloaded")
        if windows and found.hint is None:
            return Resolved(found.path, "written with backslashes")
        return found

    def _beside(self, mesh: Path, name: str) -> Path:
        name = unquote(name.replace("\\", "/").removeprefix("file://"))
        if "\0" in name or not name or "://" in name:
            raise ModelRefused("not a file name")
        try:
            return self._inside(mesh.parent / name, BESIDE).path
        except ModelRefused:
            # exporters leave the path of the artist's disk
            return self._inside(mesh.parent / PurePosixPath(name).name, BESIDE).path

    # ---- what belongs to the model ----

    def _list_own(self) -> list[Path]:
        """The package that holds the model's file; without one, the file's folder and those that may be
        beside it."""
        for marker in MARKERS:
            for folder in self._above:
                if os.path.isfile(folder / marker) and not self._is_shared(folder):
                    return [folder]
        if self._is_shared(self._folder):
            return []
        above = self._folder.parent
        beside = [] if self._is_shared(above) else [above / name for name in MESH_FOLDERS]
        return [self._folder, *(folder for folder in beside if resolve_links(folder) == folder)]

    def _is_shared(self, folder: Path) -> bool:
        """Whether it is a folder in which files of every kind lie together, or one above such a folder."""
        return any(shared.is_relative_to(folder) for shared in self._shared) or (
            EVERYTHING.fullmatch(str(folder)) is not None
        )

    def _is_package(self, folder: Path) -> bool:
        return any(os.path.isfile(folder / name) for name in MARKERS) and not self._is_shared(folder)

    def _list_packages_around(self, plain: Path) -> Iterator[Path]:
        """The packages beside or above the model in which a path lies, by its names alone."""
        for above in self._above:
            if plain.is_relative_to(above):
                beside = above.joinpath(*plain.relative_to(above).parts[:1])
                yield from (folder for folder in (above, beside) if self._is_package(folder))
                return

    def _require_inside(self, at: Path, roots: Sequence[Path]) -> None:
        """Raises ModelRefused unless it is in one of these folders, and nothing on its path is hidden."""
        if not _is_inside(at, roots):
            loose = not self._own and at.is_relative_to(self._folder)
            raise ModelRefused(SHARED if loose else OUTSIDE)
        if self._is_hidden(at):
            raise ModelRefused(HIDDEN)

    def _is_hidden(self, at: Path) -> bool:
        """Whether a name on the path begins with a dot, but for those in which the user has the model itself
        or gives a folder."""
        return any(
            name.startswith(".")
            and not any(folder.parts[:n] == at.parts[:n] for folder in (self._folder, *self._given))
            for n, name in enumerate(at.parts, 1)
        )

    # ---- packages ----

    def _in_package(self, package: str, rest: str) -> Resolved:
        if not package:  # package:///name/rest
            package, _, rest = rest.partition("/")
        if package in ("", ".", "..") or "/" in package or not rest:
            raise ModelRefused("not a file name in a package")
        refused: ModelRefused | None = None
        for folder in self._folders_of(package):
            found = self._look(folder / rest, MESHES + BESIDE)
            if isinstance(found, Resolved):
                return found
            refused = refused or found
        # A package whose folder was renamed or taken apart: the tail of the path in the model's own folders.
        names = PurePosixPath(rest).parts
        for start in (*self._own[:1], self._folder.parent):
            for i in range(len(names)):
                found = self._look(start.joinpath(*names[i:]), MESHES + BESIDE)
                if isinstance(found, Resolved):
                    hint = f"package {quote_name(package)} not found; taken from the model's own folder"
                    return Resolved(found.path, hint)
        raise refused or ModelRefused(f"no package {quote_name(package)} {NOWHERE}")

    def _folders_of(self, package: str) -> Iterator[Path]:
        """Folders of that package, the likeliest first."""
        for above in self._above:
            if above.name == package and not self._is_shared(above):
                yield self._admit(above) or above  # it holds the model: `check` decides what else it may
            # a stranger's archive may hold a link to any folder, so a link must lead to one that is as near
            beside = above / package
            if resolve_links(beside).parent in self._above and (admitted := self._admit(beside)):
                yield admitted
        if self._named is None:
            self._named = self._read_names()
        given = [folder for g in self._given for folder in (g, g / package) if folder.name == package]
        for folder in (*given, *self._named.get(package, ())):
            if admitted := self._admit(folder):
                yield admitted

    def _admit(self, folder: Path) -> Path | None:
        """Where a folder that was asked for by name really is; None unless it belongs to the model."""
        real = resolve_links(folder)
        if not os.path.isdir(real) or self._is_hidden(folder) or self._is_hidden(real):
            return None
        if not _is_inside(real, self.roots):
            if not self._is_package(real):
                return None
            self._packages[real] = None
        return real

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

    # ---- files ----

    def _inside(self, path: Path, suffixes: Sequence[str]) -> Resolved:
        found = self._look(path, suffixes)
        if isinstance(found, ModelRefused):
            raise found
        return found

    def _look(self, path: Path, suffixes: Sequence[str]) -> Resolved | ModelRefused:
        try:
            found = self._find_real(path)
        except ModelRefused as e:
            return e
        except (OSError, ValueError):  # a name too long
            return ModelRefused("no such file")
        if found.path.suffix.lower() not in suffixes:
            return ModelRefused(f"{quote_name(found.path.suffix)} is not a supported mesh or picture format")
        return found

    def _find_real(self, path: Path) -> Resolved:
        real, hint = self.check(path), None
        if not path.exists():
            other = self._in_other_letters(Path(os.path.normpath(path)))
            if other is None:
                raise ModelRefused("no such file")
            hint = f"the file is called {quote_name(other.name)}, in other upper and lower case"
            real = self.check(other)
        if not real.is_file():
            raise ModelRefused("is not a file")
        return Resolved(real, hint)

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


def _is_inside(path: Path, folders: Iterable[Path]) -> bool:
    return any(path.is_relative_to(folder) for folder in folders)


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            return sorted(Path(e.path) for e in entries if e.is_dir() and not e.name.startswith("."))
    except OSError:
        return []


def _read_package(file: Path) -> Element | None:
    try:
        with open_file(file) as source:
            return read_xml(source, bytes_max=1 << 16, elements_max=1000, depth_max=16, texts=True)
    except (OSError, ModelRefused):
        return None


def _package_name(file: Path) -> str | None:
    root = _read_package(file)
    name = root.find_first("name") if root else None
    return name.text.strip() if name else None


def _configured(file: Path) -> str:
    """The name of the SDF of the newest format that a model's folder has."""
    root = _read_package(file)
    sdfs = root.find_all("sdf") if root else ()
    found = [(e.get("version") or "", e.text.strip()) for e in sdfs if e.text.strip()]
    return max(
        found, key=lambda one: [int(w) for w in re.findall("[0-9]{1,4}", one[0])], default=("", "model.sdf")
    )[1]


def _spellings(folder: Path) -> dict[str, str]:
    """Names in a folder, by their spelling in lower case; of several the first in the alphabet."""
    try:
        with os.scandir(folder) as entries:
            few = [e.name for _, e in zip(range(ENTRIES_MAX), entries, strict=False)]
    except OSError:
        return {}
    return {name.casefold(): name for name in sorted(few, reverse=True)}
