"""The process in which a xacro file is expanded: `python -m posecast_edge.model.xacro.child`.

stdin: JSON with `path`, `packages`, `arguments`, `shared` and `wait_s`. stdout: JSON with `inputs`, `notes`
and either `text` (XML) or `reason` and `line`. Its expressions can access only data, and an
audit hook refuses every system access except reading files that belong to the model.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import json
import os
import re
import resource
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import CodeType
from typing import Any
from xml.dom import minidom
from xml.parsers.expat import ExpatError

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.text import read_text
from posecast_edge.model.urdf.resolver import Resolver, resolve_links

ATTRIBUTE = "_posecast_attribute"  # a name that no expression may use itself
EXPRESSION_MAX = 20_000  # characters

_OF_STR = """capitalize count endswith find index isalnum isalpha isdecimal isdigit islower isspace istitle
isupper join lower lstrip partition removeprefix removesuffix replace rfind rindex rpartition rsplit rstrip
split splitlines startswith strip swapcase title upper zfill center ljust rjust"""
_OF_LIST = "append copy count extend index insert pop remove reverse sort"
_OF_DICT = "copy get items keys pop setdefault update values"
_OF_SET = "add copy difference discard intersection isdisjoint issubset issuperset remove union"
METHODS: tuple[tuple[type, frozenset[str]], ...] = (
    (str, frozenset(_OF_STR.split())),
    (dict, frozenset(_OF_DICT.split())),
    (list, frozenset(_OF_LIST.split())),
    (tuple, frozenset(("count", "index"))),
    (set, frozenset(_OF_SET.split())),
    (frozenset, frozenset(_OF_SET.split())),
    (float, frozenset(("is_integer", "real", "imag"))),
    (int, frozenset(("real", "imag", "bit_length"))),
    (complex, frozenset(("real", "imag", "conjugate"))),
)


class ExpressionRefused(Exception):
    """An expression that asks for more than data: one line."""


class _Guard(ast.NodeTransformer):
    """Turns each `a.b` into a call that looks at what `a` is, and refuses names that are Python's own.

    xacro passes expressions to Python's eval() and refuses names with two underscores, which does not prevent
    access to the rest of Python (through a lambda, a generator's frame, `vars`). So only namespaces, mappings
    and plain data have attributes, and only the listed ones.
    """

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if not isinstance(node.ctx, ast.Load):
            raise ExpressionRefused("an expression can't change an attribute")
        name = ast.Constant(node.attr)
        call = ast.Call(ast.Name(ATTRIBUTE, ast.Load()), [self.visit(node.value), name], [])
        return ast.copy_location(call, node)

    def visit_Name(self, node: ast.Name) -> ast.Name:
        if node.id.startswith("__") or node.id == ATTRIBUTE:
            raise ExpressionRefused(f"an expression can't use the name {node.id[:40]!r}")
        return node


def get_attribute(value: Any, name: str) -> Any:
    """`value.name`; of a mapping that xacro made, its entry. Raises ExpressionRefused for what is no data."""
    methods = next((names for kind, names in METHODS if isinstance(value, kind)), frozenset[str]())
    if name in methods:
        return getattr(value, name)
    if isinstance(value, dict) and not name.startswith("_"):
        get = getattr(type(value), "__getattr__", None)  # xacro's namespaces, and dictionaries read from YAML
        if get is not None:
            return get(value, name)
    raise ExpressionRefused(
        f"an expression can't use the attribute {name[:40]!r} of a {type(value).__name__}"
    )


def compile_expression(text: str) -> CodeType:
    """The code of an expression, in which `a.b` calls ATTRIBUTE. Raises ExpressionRefused for what is more
    than an expression over data, and what Python raises for what is no expression."""
    if len(text) > EXPRESSION_MAX:
        raise ExpressionRefused(f"an expression of more than {EXPRESSION_MAX:,} characters")
    tree = _Guard().visit(ast.parse(text.strip(), "<expression>", "eval"))
    return compile(ast.fix_missing_locations(tree), "<expression>", "eval")


def evaluate_expression(text: str, symbols: dict[str, Any], names: Mapping[str, Any] | None = None) -> Any:
    """Evaluate as Python does, but for attributes. `names`: looked at before `symbols`.

    Raises ExpressionRefused for what is more than an expression over data, and what evaluating it raises.
    """
    code = compile_expression(text)
    symbols |= {"__builtins__": {}, ATTRIBUTE: get_attribute}
    return eval(code, symbols, names)


# --- the expansion

CPU_S = 10
MEMORY_MAX = 256 << 20  # bytes it may ask for; large robots take 60 MiB
FILES_MAX = 64  # open at a time
INPUTS_MAX = 1000
NOTES_MAX = 20
REASON_MAX = 400  # characters

GLOB = re.compile(r"[*[?]")  # as xacro tells a pattern from a name
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# what a running expansion may do as far as Python's audit hooks see it; opening a file is looked at
QUIET = {
    *("compile", "exec", "import", "marshal.loads", "object.__getattr__", "sys._getframe", "code.__new__"),
    *("sys.excepthook", "sys.unraisablehook", "glob.glob", "glob.glob/2", "builtins.id", "function.__new__"),
}
MODULES = ("yaml", "glob", "xml.dom.expatbuilder", "encodings.latin_1", "encodings.ascii")
PYTHON = Path(os.__file__).resolve().parent


class XacroRun:
    """One file's expansion: what it may read, and what it has read."""

    def __init__(
        self,
        path: Path,
        packages: Sequence[Path],
        arguments: Mapping[str, str],
        shared: Sequence[Path] | None = None,
    ) -> None:
        """`shared`: the folders that belong to no model (Resolver)."""
        self._path, self._arguments = path, dict(arguments)
        self._resolver = Resolver(path, packages, shared)
        self._found: dict[str, Path] = {}  # packages by name
        self._searching = False
        self.inputs: dict[str, None] = {}
        self.notes: list[str] = []

    def run(self) -> str:
        """The XML. Raises ModelRefused."""
        xacro = importlib.import_module("xacro")
        args = importlib.import_module("xacro.substitution_args")
        for name in MODULES:
            importlib.import_module(name)
        self._replace(xacro, args)
        sys.addaudithook(self._audit)
        try:
            document = xacro.process_file(str(self._path), mappings=self._arguments, verbosity=0)
            self._rename(document.documentElement)
            text: str = document.toprettyxml(indent="  ")
        except ExpatError as e:
            raise self._refused(xacro, f"not XML: {e}".partition(": line")[0], e.lineno) from None
        except Exception as e:  # a library's, over a stranger's file
            raise self._refused(xacro, _words(e, self._name_file)) from None
        return text

    def _refused(self, xacro: Any, reason: str, line: int | None = None) -> ModelRefused:
        stack = [file for file in xacro.filestack or [] if file]
        macro = xacro.macrostack[-1].body.getAttribute("name") if xacro.macrostack else ""
        reason = f"xacro: {reason[:REASON_MAX]}"
        if macro:
            reason += f", in macro {quote_name(macro)}"
        if stack and stack[-1] != str(self._path):
            reason += f", in {quote_name(self._name_file(stack[-1]))}" + (
                f" line {line}" if line is not None else ""
            )
            line = None
        return ModelRefused(reason, line)

    def _name_file(self, path: str) -> str:
        """Within the model's folders as it is called there."""
        plain = Path(os.path.normpath(path))
        roots = (*self._resolver.roots, *self._found.values())
        root = next((root for root in roots if plain.is_relative_to(root)), None)
        return str(plain.relative_to(root) if root is not None else plain)

    # ---- in place of xacro's own ----

    def _replace(self, xacro: Any, args: Any) -> None:
        def evaluate(text: str, symbols: dict[str, Any], names: Any = None) -> Any:
            return evaluate_expression(text, symbols, names)

        def substitute(text: str, context: dict[str, Any]) -> str:
            """`$(eval …)`."""
            given = context.setdefault("arg", {})
            known = {name: args.convert_value(str(value), "auto") for name, value in given.items()}
            own = {
                **args._eval_dict,
                "arg": lambda name: args.convert_value(args._eval_arg(name, given), "auto"),
                "dirname": lambda: args._eval_dirname(context.get("filename")),
            }
            return str(evaluate_expression(text, {**known, **own}))

        def spell(name: str) -> str:
            """A file's name as a path: `package://` is not xacro's, but people write it."""
            path = str(self._locate(name)) if "://" in name else keep(name)
            return path if GLOB.search(path) else self._look_beside(path, xacro.filestack[-1])

        def parse(source: Any, filename: str | None = None) -> Any:
            """The tree of a file, in whatever encoding it is."""
            if source is not None or filename is None:
                return keep_parse(source, filename)
            try:
                with open(filename, "rb") as file:
                    content = file.read()
            except OSError as e:
                xacro.filestack.pop()  # as xacro does: what can't be opened is not where the mistake is
                raise xacro.XacroException(f"{e.strerror}: {e.filename}", exc=e) from None
            return minidom.parseString(read_text(content).utf8)

        keep_parse, xacro.parse = xacro.parse, parse
        keep: Callable[[str], str] = xacro.abs_filename_spec
        xacro.abs_filename_spec = spell
        xacro.safe_eval = evaluate
        args._eval, args._eval_find = substitute, self._find
        args._eval_env, args._eval_optenv = _refuse_variable, _default_variable
        args._eval_dict |= {"find": self._find, "env": _refuse_variable, "optenv": _default_variable}
        symbols = xacro._global_symbols
        symbols["abs_filename"] = symbols["xacro"]["abs_filename"] = spell
        python = symbols["python"]
        dict.pop(python, "vars")
        dict.__setitem__(python, "type", _type_of)

    def _find(self, name: str) -> str:
        """`$(find NAME)`."""
        with self._search():
            found = self._resolver.find_package(name)
        self._found[name] = found
        return str(found)

    def _look_beside(self, path: str, file: str) -> str:
        """What is not where a file says may lie beside that file, in a package that was taken apart."""
        beside = os.path.join(os.path.dirname(file), os.path.basename(path))
        try:
            self._resolver.check(Path(path))
        except ModelRefused:
            return path  # and is refused when it is opened
        if os.path.exists(path) or beside == file or not os.path.isfile(beside):
            return path
        self.notes.append(f"{quote_name(self._name_file(path))} not found; taken from beside the file")
        return beside

    def _locate(self, uri: str) -> Path:
        scheme, _, rest = uri.partition("://")
        if scheme == "file":
            return Path(rest)
        package, _, rest = rest.partition("/")
        if scheme not in ("package", "model"):
            raise ModelRefused(f"{quote_name(scheme)}: files are not downloaded")
        return Path(self._find(package), rest)

    @contextlib.contextmanager
    def _search(self) -> Iterator[None]:
        self._searching = True
        try:
            yield
        finally:
            self._searching = False

    def _rename(self, root: Any) -> None:
        """Paths in packages that were found here become addresses that hold on any machine."""
        folders = {f"{folder}/": f"package://{name}/" for name, folder in self._found.items()}
        waiting = [root]
        while waiting:
            element = waiting.pop()
            waiting += [child for child in element.childNodes if child.nodeType == child.ELEMENT_NODE]
            for name in ("filename", "uri"):
                path = element.getAttribute(name).removeprefix("file://")
                for folder, address in folders.items():
                    if path.startswith(folder):
                        element.setAttribute(name, address + path.removeprefix(folder))

    # ---- the second line ----

    def _audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event in QUIET or self._searching:
            return
        if event in ("open", "os.listdir", "os.scandir"):
            self._look(event, *arguments)
            return
        raise PermissionError(1, f"no {event[:40]} from a xacro file", "")

    def _look(self, event: str, path: Any, mode: Any = "r", flags: Any = 0) -> None:
        """Whether the file may be read."""
        writes = (isinstance(flags, int) and flags & WRITES) or (
            isinstance(mode, str) and set(mode) & set("wax+")
        )
        if writes or not isinstance(path, str | bytes | os.PathLike):
            raise PermissionError(1, "a xacro file only reads files", "")
        given = Path(os.fsdecode(path))
        real = resolve_links(given)
        is_module = real.is_relative_to(PYTHON) and real.suffix in (".py", ".pyc", ".so")
        if is_module and "site-packages" not in real.parts:  # those may be the owner's own
            return  # imported late
        if real != self._path:
            try:
                with self._search():  # it may look at the package that a link leads to
                    real = self._resolver.check(given)
            except ModelRefused as e:
                raise PermissionError(1, e.reason, str(given)) from None
        if event == "open":
            if os.path.exists(real) and not os.path.isfile(real):
                raise PermissionError(1, "is not a file", str(given))  # a pipe would wait for its writer
            self.inputs[str(real)] = None
            if len(self.inputs) > INPUTS_MAX:
                raise PermissionError(1, f"more than {INPUTS_MAX} files", "")


def _type_of(value: object) -> type:
    if isinstance(value, type):
        raise ExpressionRefused("an expression can't make types")
    return type(value)


def _refuse_variable(name: str) -> str:
    advice = "a robot's file can't read your environment; expand it yourself: xacro FILE > robot.urdf"
    raise ModelRefused(f"it needs the environment variable {quote_name(name)}: {advice}")


def _default_variable(_name: str, default: str = "") -> str:
    return default


def _words(e: BaseException, name_file: Callable[[str], str]) -> str:
    """One line for what xacro, Python or a guard raised."""
    cause = e
    while isinstance(inner := getattr(cause, "exc", None), BaseException):
        cause = inner
    if isinstance(cause, ModelRefused | ExpressionRefused):
        return str(cause)
    if isinstance(cause, RecursionError):
        return "a macro or a file that includes itself"
    if isinstance(cause, MemoryError):
        return f"it takes more than {MEMORY_MAX >> 20} MiB to expand"
    if isinstance(cause, OSError):
        name = f"{quote_name(name_file(str(cause.filename)))}: " if cause.filename else ""
        return f"{name}{cause.strerror or cause}"
    text = " ".join(str(e).split()) or type(e).__name__
    if text.startswith("<class "):  # it names its cause twice
        text = f"{type(cause).__name__}: {cause}"
    if text.startswith("Undefined substitution argument"):
        name = text.rpartition(" ")[2].strip("'\"")
        return f"it needs the argument {quote_name(name)}: --xacro-arg {name}:=VALUE"
    return text


def bound_process(wait_s: float) -> None:
    """What the process may use at most, and for how long; and it knows nothing of its environment."""
    signal.setitimer(signal.ITIMER_REAL, wait_s)  # ends it, even when its parent has ended
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 1))
    # not the address space: in that a system with many languages has 200 MiB mapped from the start
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_MAX, MEMORY_MAX))
    resource.setrlimit(resource.RLIMIT_NOFILE, (FILES_MAX, FILES_MAX))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.environ.clear()


def main() -> None:
    """Entry point; ends the process."""
    asked = json.load(sys.stdin)
    out, sys.stdout, sys.stderr = sys.stdout.buffer, io.StringIO(), io.StringIO()
    bound_process(asked["wait_s"])
    packages, shared = ([Path(p) for p in asked[name]] for name in ("packages", "shared"))
    expansion = XacroRun(Path(asked["path"]), packages, asked["arguments"], shared)
    answer: dict[str, Any] = {}
    try:
        answer["text"] = expansion.run()
    except ModelRefused as e:
        answer |= {"reason": e.reason, "line": e.line}
    answer |= {"inputs": list(expansion.inputs), "notes": expansion.notes[:NOTES_MAX]}
    out.write(json.dumps(answer).encode())
    out.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
