"""Compiles a MuJoCo model and writes what is needed of it to stdout, bounded and without opening any file
that does not belong to the model. `python -m posecast_edge.model.mjcf.compiler PATH [PACKAGES…]`"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import mujoco
import numpy as np

from posecast_edge.model.finding import ModelRefused, make_printable
from posecast_edge.model.mjcf.child import ANSWER_MAX, REFUSED, limit_child, open_no_file
from posecast_edge.model.mjcf.compiled import FIELDS, CompiledModel, write_model
from posecast_edge.model.mjcf.files import ModelFiles, collect_files

# else MuJoCo writes a file MUJOCO_LOG.TXT wherever it was started
mujoco.set_mju_user_warning(lambda _text: None)

SAID_MAX = 300  # characters of what MuJoCo says
LINE = re.compile(r"\bline (\d{1,9})\b")
WRAPPING = re.compile(r"^(?:XML )?(?:Error: )+|,? (?:id \d+, )?line \d+$")  # around the words proper
QUOTED = re.compile(r"'([^']{1,1000})'")
FAILURES = (
    ValueError,
    TypeError,
    LookupError,
    RuntimeError,
    MemoryError,
    RecursionError,
    mujoco.FatalError,
)
# what MuJoCo says, and what to do
ADVICE = {
    "Unrecognized XML model type: 'mujocoinclude'": "it is a part; give the file that includes it",
    "mass and inertia of moving bodies": "give the body a mass, or <compiler boundmass> and boundinertia",
}


def make_spec(files: ModelFiles) -> tuple[Any, Any]:
    """MuJoCo's MjSpec and the MjVfs it is compiled with. Raises what MuJoCo raises (FAILURES)."""
    vfs = mujoco.MjVfs()
    for name, content in files.contents.items():
        vfs[name] = content
    return mujoco.MjSpec.from_file(files.main, vfs=vfs), vfs


def explain_failure(error: BaseException, files: ModelFiles) -> ModelRefused:
    """MuJoCo's own words as one line, with the line in the file and what to do."""
    said = make_printable(" ".join(str(error).split())[:SAID_MAX]) or type(error).__name__
    if isinstance(error, MemoryError):
        return ModelRefused("takes more memory than it may")
    found = LINE.search(said)
    line = int(found[1]) if found and int(found[1]) else None
    for name in QUOTED.findall(said):
        for wanted, reason in files.refused.items():
            if PurePosixPath(wanted).name == PurePosixPath(name.replace("\\", "/")).name:
                return ModelRefused(f"file '{make_printable(wanted[:SAID_MAX])}': {reason}", line)
    advice = next((text for words, text in ADVICE.items() if words in said), "")
    words = WRAPPING.sub("", said).replace(" Element ", "; element ")
    return ModelRefused(f"MuJoCo: {words}{f': {advice}' if advice else ''}", line)


def compile_model(path: Path, packages: Sequence[Path]) -> CompiledModel:
    """Read and compile a model. Raises ModelRefused."""
    files = collect_files(path, packages)
    try:
        with open_no_file():
            spec, vfs = make_spec(files)
            files.contents.clear()  # MuJoCo has a copy
            spec.memory = spec.nstack = spec.njmax = (
                spec.nconmax
            ) = -1  # for simulating, which nobody does here
            spec.compiler.usethread = False  # a thread each takes memory of its own
            spec.compiler.discardvisual = False
            spec.compiler.fusestatic = False
            model = spec.compile(vfs)
    except FAILURES as e:
        raise explain_failure(e, files) from None
    return _extract(spec, model, files)


def _extract(spec: Any, model: Any, files: ModelFiles) -> CompiledModel:
    arrays = {name: np.asarray(getattr(model, name)) for name in FIELDS}
    for name, (_, width) in FIELDS.items():
        arrays[name] = arrays[name].reshape((-1, width) if width > 1 else (-1,))
    if sum(values.nbytes for values in arrays.values()) > ANSWER_MAX - (32 << 20):
        raise ModelRefused(f"compiled it is over {ANSWER_MAX >> 20} MiB")
    actuated = model.nu > 0
    names = {
        "body": [model.body(i).name or f"body{i}" for i in range(model.nbody)],
        "joint": [name_joint(model, i, actuated) for i in range(model.njnt)],
        "mesh": [model.mesh(i).name or f"mesh{i}" for i in range(model.nmesh)],
        "site": [model.site(i).name or f"site{i}" for i in range(model.nsite)],
    }
    lines = {
        kind: _lines(elements, count)
        for kind, elements, count in (
            ("body", spec.bodies, model.nbody),
            ("joint", spec.joints, model.njnt),
            ("geom", spec.geoms, model.ngeom),
        )
    }
    inputs = tuple(str(p) for p in files.inputs)
    return CompiledModel(arrays, names, lines, str(spec.modelname), model.nskin, model.nflex, inputs)


def _lines(elements: Any, count: int) -> list[int]:
    """In the main file; MuJoCo knows none of includes."""
    lines = [0] * count
    for element in elements:
        found = LINE.search(element.info or "")
        if found and 0 <= element.id < count:
            lines[element.id] = int(found[1])
    return lines


def name_joint(model: Any, i: int, actuated: bool) -> str:
    """What joint `i` is called, here and by the source `mujoco`, which gives servos, and for these names, to
    a model without actuators."""
    return str(model.joint(i).name) or (f"joint{i}" if actuated else f"unnamed joint {i}")


def main(arguments: Sequence[str]) -> int:
    """Compile one model. Returns the exit status; a refusal goes to stderr as JSON: line or null, reason."""
    limit_child()
    path, *packages = map(Path, arguments)
    try:
        try:
            write_model(compile_model(path, packages), sys.stdout.buffer)
        except MemoryError:
            raise ModelRefused("takes more memory than it may") from None
        except OSError as e:
            raise ModelRefused(e.strerror or str(e)) from None
    except ModelRefused as e:
        print(json.dumps([e.line, e.reason]), file=sys.stderr)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
