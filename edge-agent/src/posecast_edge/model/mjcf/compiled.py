"""The needed parts of a compiled MuJoCo model, as plain arrays sent from the compiling process to ours."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused, make_printable
from posecast_edge.model.mjcf.child import ANSWER_MAX

HEAD_MAX = 16 << 20  # bytes of names and shapes
PICTURE_PIXELS_MAX = 4096 * 4096
TYPES = {"float64": 8, "float32": 4, "int32": 4, "uint8": 1}  # bytes of a number

# Named as in MuJoCo's mjModel: kind of number, and how many of them a row has (1: it is no row).
FIELDS = {
    **dict.fromkeys(("body_parentid", "body_mocapid"), ("int32", 1)),
    # not MuJoCo's: whether it is a vertex of a soft part, whether an actuator acts on it
    **dict.fromkeys(("body_soft", "body_driven"), ("uint8", 1)),
    "body_pos": ("float64", 3),
    "body_quat": ("float64", 4),
    "body_mass": ("float64", 1),  # below 0: it follows from a mesh that was taken out
    **dict.fromkeys(("body_ipos", "body_inertia"), ("float64", 3)),
    "body_iquat": ("float64", 4),
    **dict.fromkeys(("jnt_type", "jnt_bodyid", "jnt_qposadr"), ("int32", 1)),
    **dict.fromkeys(("jnt_limited", "jnt_actfrclimited"), ("uint8", 1)),
    **dict.fromkeys(("jnt_pos", "jnt_axis"), ("float64", 3)),
    **dict.fromkeys(("jnt_range", "jnt_actfrcrange"), ("float64", 2)),
    "qpos0": ("float64", 1),
    **dict.fromkeys(("eq_type", "eq_obj1id", "eq_obj2id"), ("int32", 1)),
    "eq_active0": ("uint8", 1),
    "eq_data": ("float64", 12),
    **dict.fromkeys(("geom_type", "geom_bodyid", "geom_dataid", "geom_group", "geom_matid"), ("int32", 1)),
    **dict.fromkeys(("geom_contype", "geom_conaffinity"), ("int32", 1)),
    **dict.fromkeys(("geom_pos", "geom_size"), ("float64", 3)),
    "geom_quat": ("float64", 4),
    **dict.fromkeys(("geom_rgba", "mat_rgba"), ("float32", 4)),
    "mat_texid": ("int32", 10),
    **dict.fromkeys(("mesh_vertadr", "mesh_vertnum", "mesh_faceadr", "mesh_facenum"), ("int32", 1)),
    **dict.fromkeys(("mesh_texcoordadr", "mesh_texcoordnum"), ("int32", 1)),
    **dict.fromkeys(("mesh_face", "mesh_facetexcoord"), ("int32", 3)),
    "mesh_vert": ("float32", 3),
    "mesh_texcoord": ("float32", 2),
    **dict.fromkeys(("tex_type", "tex_height", "tex_width", "tex_nchannel", "tex_adr"), ("int32", 1)),
    "tex_data": ("uint8", 1),
    **dict.fromkeys(("site_bodyid", "sensor_type", "sensor_objtype", "sensor_objid"), ("int32", 1)),
    "site_pos": ("float64", 3),
    "site_quat": ("float64", 4),
}
NAMED = {"body": "body", "jnt": "joint", "site": "site"}  # what a field's rows are, by its first word


@dataclass(frozen=True)
class CompiledModel:
    """`arrays`: those of FIELDS; `names`: of bodies, joints, meshes and sites, by kind; `lines`: of bodies,
    joints and geoms in the file, 0 where it is not known; `name`: the model's; `skins`, `flexes`: how many
    soft parts it has; `inputs`: the files that were read; `remarks`: what is not shown, and why."""

    arrays: Mapping[str, NDArray[Any]]
    names: Mapping[str, list[str]]
    lines: Mapping[str, list[int]]
    name: str
    skins: int
    flexes: int
    inputs: tuple[str, ...]
    remarks: tuple[str, ...] = ()

    def __getitem__(self, field: str) -> NDArray[Any]:
        return self.arrays[field]

    def count(self, kind: str) -> int:
        """How many bodies, joints, meshes or sites there are."""
        return len(self.names[kind])


def write_model(model: CompiledModel, out: IO[bytes]) -> None:
    """Write it: a line of JSON, then the arrays' bytes one after the other."""
    head = {
        "rows": {name: len(values) for name, values in model.arrays.items()},
        "names": model.names,
        "lines": model.lines,
        "name": model.name,
        "skins": model.skins,
        "flexes": model.flexes,
        "inputs": model.inputs,
        "remarks": model.remarks,
    }
    out.write(json.dumps(head).encode() + b"\n")
    for name, (kind, _) in FIELDS.items():
        out.write(np.ascontiguousarray(model.arrays[name], np.dtype(kind)).data)
    out.flush()


def read_model(source: IO[bytes]) -> CompiledModel:
    """Read what `write_model` wrote. Raises ModelRefused when it is anything else."""
    try:
        head = json.loads(source.readline(HEAD_MAX))
        texts = {kind: [str(n) for n in names] for kind, names in head["names"].items()}
        arrays = {}
        for name, (kind, width) in FIELDS.items():
            rows = int(head["rows"][name])
            if not 0 <= rows <= ANSWER_MAX:
                raise ValueError("a number of rows that is none")
            if name.partition("_")[0] in NAMED and rows != len(texts[NAMED[name.partition("_")[0]]]):
                raise ValueError("rows without a name")
            data = source.read(rows * width * TYPES[kind])
            values = np.frombuffer(data, np.dtype(kind), rows * width)
            if kind.startswith("float") and not np.isfinite(values).all():
                raise ModelRefused(f"numbers that are not finite in MuJoCo's {name}")
            arrays[name] = values.reshape(rows, width) if width > 1 else values
        lines = {kind: [int(n) for n in numbers] for kind, numbers in head["lines"].items()}
        return CompiledModel(
            arrays,
            texts,
            lines,
            str(head["name"]),
            int(head["skins"]),
            int(head["flexes"]),
            tuple(str(n) for n in head["inputs"]),
            tuple(make_printable(str(n)) for n in head.get("remarks", ())),
        )
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, MemoryError, RecursionError):
        raise ModelRefused("MuJoCo's compiler gave no usable answer") from None
