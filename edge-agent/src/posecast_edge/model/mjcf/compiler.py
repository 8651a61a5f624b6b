"""Compiles a MuJoCo model and writes the needed parts to stdout, within limits, and opens only files that
belong to the model. `python -m posecast_edge.model.mjcf.compiler PATH [PACKAGES…]`"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused, make_printable, quote_name
from posecast_edge.model.mjcf.assets import (
    FAILURES,
    AssetFailed,
    TakenAssets,
    TakenMesh,
    list_guessed_bodies,
    take_assets,
)
from posecast_edge.model.mjcf.bodies import find_driven_bodies, find_soft_bodies
from posecast_edge.model.mjcf.child import ANSWER_MAX, REFUSED, limit_child, open_no_file
from posecast_edge.model.mjcf.compiled import FIELDS, CompiledModel, write_model
from posecast_edge.model.mjcf.files import ModelFiles, collect_files

# otherwise MuJoCo writes a file MUJOCO_LOG.TXT into the current folder
mujoco.set_mju_user_warning(lambda _text: None)
# otherwise it keeps a copy of every mesh, to compile the same model again
mujoco.mj_setCacheCapacity(mujoco.mj_getCache(), 0)

MESSAGE_MAX = 300  # characters of what MuJoCo says
LINE = re.compile(r"\bline (\d{1,9})\b")
WRAPPING = re.compile(r"^(?:XML )?(?:Error: )+|,? (?:id \d+, )?line \d+$")  # around the words proper
QUOTED = re.compile(r"'([^']{1,1000})'")
ELEMENT = re.compile(r" Element name '[^']*'$")
UNKNOWN = "unknown exception"  # all that is left of an exception that MuJoCo's Python doesn't know
SAVE_AGAIN = "save it again as binary STL, OBJ or PNG, for example with Blender or GIMP"
TAKE_APART = "try it in MuJoCo's viewer (python -m mujoco.viewer --mjcf FILE), and with parts removed"
# MuJoCo's message → what to do
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


def explain_failure(error: BaseException, files: ModelFiles, asset: str = "") -> ModelRefused:
    """MuJoCo's message as one line, with the line in the file and what to do. `asset`: the mesh or texture
    that was read, with its file; "" for the model itself."""
    message = make_printable(" ".join(str(error).split())[:MESSAGE_MAX]) or type(error).__name__
    head = f"{asset}: " if asset else ""
    if isinstance(error, MemoryError):
        return ModelRefused(f"{head}needs more memory than is allowed")
    found = LINE.search(message)
    line = int(found[1]) if found and int(found[1]) else None
    if UNKNOWN in message.lower():
        what = asset or f"file {quote_name(PurePosixPath(files.main).name)}, or one that it names"
        advice = SAVE_AGAIN if asset else TAKE_APART
        return ModelRefused(f"{what}: MuJoCo failed without a reason: {advice}", line)
    for name in QUOTED.findall(message):
        for wanted, reason in files.refused.items():
            if PurePosixPath(wanted).name == PurePosixPath(name.replace("\\", "/")).name:
                return ModelRefused(f"file '{make_printable(wanted[:MESSAGE_MAX])}': {reason}", line)
    advice = next((text for words, text in ADVICE.items() if words in message), SAVE_AGAIN if asset else "")
    words = WRAPPING.sub("", message)
    words = ELEMENT.sub("", words) if asset else words.replace(" Element ", "; element ")
    return ModelRefused(f"{head}MuJoCo: {words}{f': {advice}' if advice else ''}", line)


def compile_model(path: Path, packages: Sequence[Path]) -> CompiledModel:
    """Read and compile a model. Raises ModelRefused."""
    files = collect_files(path, packages)
    try:
        with open_no_file():
            spec, vfs = make_spec(files)
            vfs.close()  # it has copies, of which the small models need one at a time
            taken = take_assets(spec, files.contents)
            vfs = mujoco.MjVfs()
            while files.contents:
                name, content = files.contents.popitem()
                vfs[name] = content
            spec.memory = spec.nstack = spec.njmax = (
                spec.nconmax
            ) = -1  # for simulating, which nobody does here
            spec.compiler.usethread = False  # a thread each takes memory of its own
            spec.compiler.discardvisual = False
            spec.compiler.fusestatic = False
            model = spec.compile(vfs)
    except AssetFailed as e:
        raise explain_failure(e.__cause__ or e, files, str(e)) from None
    except FAILURES as e:
        raise explain_failure(e, files) from None
    return _extract(spec, model, files, taken)


def _extract(spec: Any, model: Any, files: ModelFiles, taken: TakenAssets) -> CompiledModel:
    soft, driven = find_soft_bodies(model), np.zeros(model.nbody, np.uint8)
    driven[find_driven_bodies(model)] = 1
    arrays = {"body_soft": np.array(soft, np.uint8), "body_driven": driven}
    arrays |= {name: np.asarray(getattr(model, name)) for name in FIELDS if name not in arrays}
    arrays |= _put_back(model, taken)
    arrays["body_mass"] = np.array(model.body_mass)
    arrays["body_mass"][list_guessed_bodies(spec, taken.boxes)] = -1
    for name, (_, width) in FIELDS.items():
        arrays[name] = arrays[name].reshape((-1, width) if width > 1 else (-1,))
    if sum(values.nbytes for values in arrays.values()) > ANSWER_MAX - (32 << 20):
        raise ModelRefused(f"compiled it is over {ANSWER_MAX >> 20} MiB")
    names = {
        "body": [model.body(i).name or f"body{i}" for i in range(model.nbody)],
        "joint": name_joints(model, soft, model.nu > 0),
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
    return CompiledModel(
        arrays, names, lines, str(spec.modelname), model.nskin, model.nflex, inputs, tuple(taken.remarks)
    )


def _put_back(model: Any, taken: TakenAssets) -> dict[str, Any]:
    """The arrays of meshes and textures, with what was taken out of the model instead of what stood in."""
    meshes = [taken.meshes.get(model.mesh(i).name) or _get_mesh(model, i) for i in range(model.nmesh)]
    pictures = []
    for i in range(model.ntex):
        pixels = taken.pictures.get(model.tex(i).name)
        pictures.append(_get_picture(model, i) if pixels is None else pixels)
    texels = _join("tex_data", [pixels.reshape(-1) for pixels in pictures])
    return {
        **_join("mesh_vert", [m.positions for m in meshes]),
        **_join("mesh_face", [m.faces for m in meshes]),
        **_join("mesh_texcoord", [m.uv for m in meshes]),
        "mesh_facetexcoord": _join("mesh_facetexcoord", [m.corners for m in meshes])["mesh_facetexcoord"],
        "tex_data": texels["tex_data"],
        "tex_adr": texels["tex_dataadr"],
        **{
            f"tex_{side}": np.array([pixels.shape[axis] for pixels in pictures], np.int32)
            for axis, side in enumerate(("height", "width", "nchannel"))
        },
    }


def _join(field: str, parts: Sequence[NDArray[Any]]) -> dict[str, Any]:
    """Arrays one behind the other as a field of MuJoCo's, and where each begins, and how long it is."""
    kind, width = FIELDS[field]
    counts = [len(part) for part in parts]
    empty = np.zeros((0, width) if width > 1 else 0, kind)
    return {
        field: np.concatenate([empty, *parts]),
        f"{field}adr": np.cumsum([0, *counts[:-1]] if counts else [], dtype=np.int32),
        f"{field}num": np.array(counts, np.int32),
    }


def _get_mesh(model: Any, i: int) -> TakenMesh:
    """One that stayed in the model."""
    at, count = model.mesh_vertadr[i], model.mesh_vertnum[i]
    first, faces = model.mesh_faceadr[i], model.mesh_facenum[i]
    start, corners = model.mesh_texcoordadr[i], model.mesh_texcoordnum[i]
    return TakenMesh(
        model.mesh_vert[at : at + count],
        model.mesh_face[first : first + faces],
        model.mesh_texcoord[start : start + corners] if corners else model.mesh_texcoord[:0],
        model.mesh_facetexcoord[first : first + faces],
    )


def _get_picture(model: Any, i: int) -> NDArray[np.uint8]:
    start, shape = model.tex_adr[i], [model.tex_height[i], model.tex_width[i], model.tex_nchannel[i]]
    pixels: NDArray[np.uint8] = model.tex_data[start : start + int(np.prod(shape))]
    return pixels.reshape(shape)


def _lines(elements: Any, count: int) -> list[int]:
    """In the main file; MuJoCo knows none of includes."""
    lines = [0] * count
    for element in elements:
        found = LINE.search(element.info or "")
        if found and 0 <= element.id < count:
            lines[element.id] = int(found[1])
    return lines


def name_joints(model: Any, soft: Sequence[int], actuated: bool) -> list[str]:
    """What the joints are called, here and by the source `mujoco`, which gives servos, and for these names,
    to a model without actuators. `soft`: see find_soft_bodies; the joints of these bodies are not numbered.
    """
    names: list[str] = []
    number = 0
    for i, body in enumerate(model.jnt_bodyid.tolist()):
        own = str(model.joint(i).name) or (f"joint{number}" if actuated else f"unnamed joint {number}")
        names.append("" if soft[body] else own)
        number += not soft[body]
    return names


def main(arguments: Sequence[str]) -> int:
    """Compile one model. Returns the exit status; a refusal goes to stderr as JSON: line or null, reason."""
    limit_child()
    path, *packages = map(Path, arguments)
    try:
        try:
            write_model(compile_model(path, packages), sys.stdout.buffer)
        except MemoryError:
            raise ModelRefused("needs more memory than is allowed") from None
        except OSError as e:
            raise ModelRefused(e.strerror or str(e)) from None
    except ModelRefused as e:
        print(json.dumps([e.line, e.reason]), file=sys.stderr)
        return REFUSED
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
