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
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO
from urllib.parse import unquote

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
MISSING = "no such file"
SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):(.*)", re.DOTALL)  # one letter is a disk, as in C:/…
DISK = re.compile(r"/*[A-Za-z]:/")
SHOWN_PARTS = 3  # of a path outside
SHOWN_MAX = 120  # characters of a path in a message
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
        self._linked: dict[Path, Path] = {}  # files in other folders, by which the model has a link to them
        self._files: dict[str, list[tuple[tuple[str, ...], Path]]] | None = None  # the model's own, by name
        self.asked: dict[tuple[str, str], Path | None] = {}  # (URI, "") or (mesh, name): what was found

    def check(self, path: Path) -> Path:
        """The real path of an absolute path, which may be read if there is something. Raises ModelRefused,
        which says why, when it does not belong to the model. Every file of every format passes here.

        A link may lead out of the model's folders to the same file of the same package, as `colcon build
        --symlink-install` makes them."""
        plain = Path(os.path.normpath(path))
        roots = [*self.roots, *self._packages]
        if not _is_inside(plain, roots):
            roots += self._list_packages_around(plain)
        self._require_inside(plain, roots)  # what is outside is not even looked for
        real = resolve_links(path)
        if not _is_inside(real, roots):
            if not self._is_installed(plain, real, roots):
                raise ModelRefused(f"is a link to {self._show(real)}, which {OUTSIDE}")
            self._linked[real] = plain
            roots = [real]
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
        found = self._look(path, DESCRIPTIONS)
        if isinstance(found, ModelRefused):
            raise found
        return found.path

    def find_beside(self, mesh: Path, name: str) -> Path:
        """A texture or material library that a mesh names, relative to the mesh. Raises ModelRefused."""
        self.asked[str(mesh), name] = None
        found = self.asked[str(mesh), name] = self._beside(mesh, name)
        return found

    def find_at(self, path: Path, suffixes: Sequence[str]) -> Path:
        """The real path of a file at an absolute path, for a format that names its files by paths. Raises
        ModelRefused, which says why there is none."""
        found = self._look(Path(os.path.normpath(path)), suffixes)
        if isinstance(found, ModelRefused):
            raise found
        return found.path

    def _find(self, uri: str) -> Resolved:
        """As the page does (spa/src/urdf/file_finder.ts): by the name as written, then unquoted, each also in
        other letters, then by the end of its path."""
        if "\0" in unquote(uri) or len(uri) > URI_MAX or uri.replace("\\", "/").count("/") > PARTS_MAX:
            raise ModelRefused("not a file name")
        scheme, name = _split_scheme(uri)
        if scheme not in ("", "file", "package", "model"):
            raise ModelRefused(f"{scheme}: files are not downloaded")
        names = list_spellings(name)
        found = self._first((p for n in names for p in self._list_places(scheme, n)), names, MESHES + BESIDE)
        if isinstance(found, ModelRefused):
            raise found
        if "\\" in uri and found.hint is None:
            return Resolved(found.path, "written with backslashes")
        return found

    def _list_places(self, scheme: str, name: str) -> Iterator[Path | ModelRefused]:
        """Where a file of that name may be, the likeliest first, or why it can't be anywhere."""
        if scheme in ("package", "model"):
            package, _, inside = name.lstrip("/").partition("/")
            if package in ("", ".", "..") or not inside.strip("/"):
                yield ModelRefused("not a file name in a package")
                return
            folders = list(self._folders_of(package))
            yield from (folder / inside.strip("/") for folder in folders)
            if not folders:
                yield ModelRefused(f"no package {quote_name(package)} {NOWHERE}")
            return
        if scheme:
            # file:///a and file:/a are absolute; people also write file://a
            name = name.removeprefix("//localhost") if name.startswith("//localhost/") else name
            name = name[2:] if name.startswith("//") else name
        if not DISK.match(name):
            yield from (folder / name for folder in (self._folder, *self._given))

    def _beside(self, mesh: Path, name: str) -> Path:
        scheme, name = _split_scheme(name)
        if "\0" in unquote(name) or not name or scheme not in ("", "file") or "://" in name:
            raise ModelRefused("not a file name")
        names = list_spellings(name.lstrip("/") if scheme else name)
        folder = self._linked.get(mesh, mesh).parent
        for found in (self._look(folder / n, BESIDE) for n in names):
            if isinstance(found, Resolved):
                return found.path
        # exporters leave the path of the artist's disk
        found = self._first((folder / PurePosixPath(n).name for n in names), names, BESIDE)
        if isinstance(found, ModelRefused):
            raise found
        return found.path

    def _first(
        self, places: Iterable[Path | ModelRefused], names: Sequence[str], suffixes: Sequence[str]
    ) -> Resolved | ModelRefused:
        """The first of these files that there is, else the model's own whose path ends most alike. The answer
        to a name that leads nowhere says where was looked."""
        refused: ModelRefused | None = None
        looked: dict[str, None] = {}
        for place in places:
            found = place if isinstance(place, ModelRefused) else self._look(place, suffixes)
            if isinstance(found, Resolved):
                return found
            if found.reason != MISSING:
                refused = refused or found
            elif not isinstance(place, ModelRefused) and len(looked) < 2:
                looked[self._show(Path(os.path.normpath(place)))] = None
        for name in names:
            if (end := self._find_by_end(name, suffixes)) is not None:
                found = self._look(end, suffixes)
                if isinstance(found, Resolved):
                    hint = f"not where it says; {self._show(end)} is taken from the model's own folder"
                    return Resolved(found.path, hint)
        last = PurePosixPath(names[-1]).name
        where = " and ".join([*looked, f"any {quote_name(last)} in the robot's folder"])
        return refused or ModelRefused(f"{MISSING}; looked for {where}")

    def _find_by_end(self, name: str, suffixes: Sequence[str]) -> Path | None:
        """The model's own file whose path ends like this name with the most parts. One part is enough only
        beside the model's file and in its package's folder: a name like link.stl may be anywhere."""
        parts = tuple(
            fold_name(part) for part in DISK.sub("", name).split("/") if part not in ("", ".", "..")
        )
        if self._files is None:
            self._files = self._list_files()
        tops = (self._folder, *self._own[:1])
        found = [
            (-end, len(own), own, path)
            for own, path in self._files.get(parts[-1] if parts else "", ())
            if path.suffix.lower() in suffixes
            and ((end := count_common_end(own, parts)) > 1 or path.parent in tops)
        ]
        return min(found)[3] if found else None

    def _list_files(self) -> dict[str, list[tuple[tuple[str, ...], Path]]]:
        """The files in the model's own folders by their folded names, with the parts of their paths."""
        files: dict[str, list[tuple[tuple[str, ...], Path]]] = {}
        left = ENTRIES_MAX
        for root in self._own:
            for folder, subfolders, names in os.walk(root):
                subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
                left -= len(names)
                if left < 0:
                    return files
                for name in sorted(names):
                    path = Path(folder, name)
                    if not name.startswith(".") and path.suffix.lower() in MESHES + BESIDE:
                        parts = tuple(map(fold_name, path.relative_to(root.parent).parts))
                        files.setdefault(parts[-1], []).append((parts, path))
        return files

    def _show(self, path: Path) -> str:
        """A path for a message that viewers may read: from the package's folder on, or from the model's; of a
        path elsewhere only the end, because its beginning tells of this machine."""
        root = self._own[0] if self._own else self._folder
        is_package = any((root / marker).is_file() for marker in MARKERS)
        base = root.parent if is_package else root
        inside = path.is_relative_to(base) and base != base.parent
        shown = str(path.relative_to(base)) if inside else "/".join(["…", *path.parts[-SHOWN_PARTS:]])
        return quote_name(shown if len(shown) <= SHOWN_MAX else f"…{shown[-SHOWN_MAX:]}", SHOWN_MAX + 1)

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

    def _is_installed(self, plain: Path, real: Path, roots: Sequence[Path]) -> bool:
        """Whether a link leads to the same file of the same package: to the same place below a folder whose
        package.xml has the same name."""
        for n in range(1, len(plain.parts)):
            package, end = plain.parents[n - 1], plain.parts[-n:]
            if not _is_inside(package, roots) or not _is_inside(resolve_links(package), roots):
                return False
            if real.parts[-n:] == end and (name := _package_name(package / "package.xml")):
                source = real.parents[n - 1]
                return not self._is_shared(source) and _package_name(source / "package.xml") == name
        return False

    def _is_hidden(self, at: Path) -> bool:
        """Whether a name on the path begins with a dot, but for those in which the user has the model itself
        or gives a folder."""
        return any(
            name.startswith(".")
            and not any(folder.parts[:n] == at.parts[:n] for folder in (self._folder, *self._given))
            for n, name in enumerate(at.parts, 1)
        )

    # ---- packages ----

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

    def _look(self, path: Path, suffixes: Sequence[str]) -> Resolved | ModelRefused:
        try:
            found = self._find_real(path)
        except ModelRefused as e:
            return e
        except (OSError, ValueError):  # a name too long
            return ModelRefused(MISSING)
        if found.path.suffix.lower() not in suffixes:
            return ModelRefused(f"{quote_name(found.path.suffix)} is not a supported mesh or picture format")
        return found

    def _find_real(self, path: Path) -> Resolved:
        real = self.check(path)
        hint: str | None = None
        if not path.exists():
            path = Path(os.path.normpath(path))
            other = self._in_other_letters(path)
            if other is None:
                raise ModelRefused(MISSING)
            if unicodedata.normalize("NFC", str(other)) != unicodedata.normalize("NFC", str(path)):
                hint = f"the file is called {quote_name(other.name)}, in other upper and lower case"
            real = self.check(other)
        if not real.is_file():
            raise ModelRefused("is not a file")
        return Resolved(real, hint)

    def _in_other_letters(self, path: Path) -> Path | None:
        """The same path in other upper and lower case, for what was made on Windows, or with letters written
        in another way, for what comes from a Mac."""
        at = Path(path.anchor)
        for name in path.parts[1:]:
            if (at / name).exists() or name == "..":
                at /= name
                continue
            if at not in self._spellings:
                self._spellings[at] = _spellings(at)
            spelling = self._spellings[at].get(fold_name(name))
            if spelling is None:
                return None
            at /= spelling
        return at


def list_spellings(name: str) -> list[str]:
    """The names that may be meant: as written, unquoted (%20), and without the query or fragment of a URI."""
    plain = name.replace("\\", "/")
    return list(
        dict.fromkeys([plain, unquote(plain), unquote(re.split("[?#]", plain, maxsplit=1)[0]) or plain])
    )


def fold_name(name: str) -> str:
    """A name for comparison: in lower case, and with each accented letter as one character."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).upper().lower())


def count_common_end(a: Sequence[str], b: Sequence[str]) -> int:
    """How many parts of two paths agree, from their ends."""
    return next(
        (n for n, (x, y) in enumerate(zip(a[::-1], b[::-1], strict=False)) if x != y), min(len(a), len(b))
    )


def _split_scheme(uri: str) -> tuple[str, str]:
    """The scheme in lower case, "" without one, and what follows its colon."""
    found = SCHEME.fullmatch(uri)
    return (found[1].lower(), found[2]) if found else ("", uri)


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
    """Names in a folder, by their folded spelling; of several the first in the alphabet."""
    try:
        with os.scandir(folder) as entries:
            few = [e.name for _, e in zip(range(ENTRIES_MAX), entries, strict=False)]
    except OSError:
        return {}
    return {fold_name(name): name for name in sorted(few, reverse=True)}
