"""The structs of hubo-ach's hubo.h as C declares them (packed), for every version's size. Written from the
header, independent of the decoder: tests fill these and send their bytes."""

from __future__ import annotations

import ctypes
from typing import Any

F64, U8, I16 = ctypes.c_double, ctypes.c_uint8, ctypes.c_int16


def _struct(name: str, *fields: tuple[str, Any]) -> type[ctypes.LittleEndianStructure]:
    return type(name, (ctypes.LittleEndianStructure,), {"_pack_": 1, "_fields_": list(fields)})


IMU = _struct("hubo_imu", *((n, F64) for n in ("a_x", "a_y", "a_z", "w_x", "w_y", "w_z")))
FT = _struct("hubo_ft", *((n, F64) for n in ("m_x", "m_y", "f_z")))
POWER = _struct("hubo_power", *((n, F64) for n in ("voltage", "current", "power")))
JMC = _struct("hubo_jmc_state", ("temp", F64))
STATUS_BYTES = (
    "driverOn", "ctrlOn", "mode", "limitSwitch", "homeFlag", "jam", "pwmSaturated", "bigError", "encError",
    "driverFault", "motorFail0", "motorFail1", "posMinError", "posMaxError", "velError", "accError",
    "tempError",
)  # fmt: skip
STATUS = _struct("hubo_joint_status", *((n, U8) for n in STATUS_BYTES))


def state(
    *, comply: bool = True, duty: bool = True, drivers: int = 54, power: bool = True, multi: bool = False
) -> Any:
    """An empty hubo_state of the version that has these members. Every joint of the robot is active."""
    joint = _struct(
        "hubo_joint_state",
        ("ref", F64),
        *([("comply", U8)] if comply else []),
        ("pos", F64),
        ("cur", F64),
        ("vel", F64),
        *([("duty", F64)] if duty else []),
        ("heat", F64),
        ("tmp", F64),
        ("active", U8),
        ("zeroed", U8),
    )
    whole = _struct(
        "hubo_state",
        ("imu", IMU * 3),
        ("ft", FT * 4),
        ("joint", joint * 42),
        ("status", STATUS * 42),
        ("driver", JMC * drivers),
        *([("power", POWER)] if power else []),
        ("time", F64),
        ("refWait", I16),
        *([("multi", U8)] if multi else []),
    )()
    for i in range(42):
        whole.joint[i].active = i not in (18, 25)
    return whole


# sizeof(hubo_state) by revision of the header → how it is made
VERSIONS: dict[int, dict[str, Any]] = {
    3898: {},
    3874: {"power": False},
    3875: {"power": False, "multi": True},
    3746: {"power": False, "drivers": 38},
    3704: {"power": False, "drivers": 38, "comply": False},
    3368: {"power": False, "drivers": 38, "comply": False, "duty": False},
    3369: {"power": False, "drivers": 38, "comply": False, "duty": False, "multi": True},
}

# joint.table's order
NAMES = [
    "WST",
    "NKY",
    "NK1",
    "NK2",
    "LSP",
    "LSR",
    "LSY",
    "LEB",
    "LWY",
    "LWR",
    "LWP",
    "RSP",
    "RSR",
    "RSY",
    "REB",
    "RWY",
    "RWR",
    "RWP",
    "-",
    "LHY",
    "LHR",
    "LHP",
    "LKN",
    "LAP",
    "LAR",
    "-",
    "RHY",
    "RHR",
    "RHP",
    "RKN",
    "RAP",
    "RAR",
    "RF1",
    "RF2",
    "RF3",
    "RF4",
    "RF5",
    "LF1",
    "LF2",
    "LF3",
    "LF4",
    "LF5",
]
SLOT = {name: i for i, name in enumerate(NAMES) if name != "-"}
