"""What the robot looks like: white shells that follow the limb, dark joint housings, one calm accent."""

from __future__ import annotations

from collections.abc import Iterator

from demo_robot.robot import FINGERS, FOREARM, SHIN, THIGH, UPPER_ARM, Visual
from demo_robot.shapes import Cap, Loft, Mesh, Section, along, ball, disc, joined, loft

Part = tuple[str, str, str, Mesh]  # link, mesh file, colour, shape


def parts() -> Iterator[Part]:
    """Every shell. A mesh that serves both sides is yielded once a link, under one name."""
    yield from _trunk()
    yield from _head()
    for s, y in (("L", 1), ("R", -1)):
        yield from _leg(s, y)
        yield from _arm(s, y)
        yield from _hand(s, y)


def build() -> tuple[dict[str, Mesh], dict[str, list[Visual]]]:
    """Mesh files by stem, and what stands on each link."""
    meshes: dict[str, Mesh] = {}
    visuals: dict[str, list[Visual]] = {}
    for link, stem, colour, mesh in parts():
        meshes.setdefault(stem, mesh)
        visuals.setdefault(link, []).append(Visual(stem, colour))
    return meshes, visuals


def _trunk() -> Iterator[Part]:
    yield (
        "Body_Hip",
        "hip_core",
        "graphite",
        loft(
            [
                Section(-0.050, 0.034, 0.036, 0.019, x=0.002, n=2.6),
                Section(-0.006, 0.050, 0.054, 0.026, n=2.6),
                Section(0.036, 0.066, 0.072, 0.090, n=2.6),
                Section(0.070, 0.066, 0.070, 0.096, n=2.6),
                Section(0.122, 0.058, 0.062, 0.080, n=2.4),
            ],
            Cap(0.014, 0.6),
            Cap(0.010, 0.2),
            14,
            36,
        ),
    )
    pelvis = Loft(
        [
            Section(0.022, 0.066, 0.072, 0.100, n=2.7),
            Section(0.044, 0.077, 0.083, 0.115, n=2.7),
            Section(0.070, 0.078, 0.084, 0.117, n=2.7),
            Section(0.104, 0.067, 0.073, 0.099, n=2.6),
        ],
        Cap(0.012, 0.25),
        Cap(0.014, 0.25),
    )
    yield "Body_Hip", "pelvis", "white", pelvis.mesh(10, 44)
    yield "Body_Hip", "pelvis_plate", "graphite", pelvis.patch((0, 0.062), (20, 0.011), 0.0022, n=3.4)

    core = [
        Section(0.000, 0.060, 0.062, 0.084, n=2.3),
        Section(0.040, 0.056, 0.060, 0.078, n=2.3),
        Section(0.100, 0.062, 0.066, 0.090, n=2.4),
        Section(0.150, 0.078, 0.078, 0.112, n=2.6),
        Section(0.190, 0.084, 0.080, 0.122, n=2.7),
    ]
    yield "Body_Torso", "abdomen", "graphite", loft(core, Cap(0.010, 0.2), Cap(0.01, 0.2, 2), 12, 40)
    yield (
        "Body_Torso",
        "waist_ring",
        "accent",
        loft(
            [Section(0.014, 0.0630, 0.0655, 0.0865, n=2.3), Section(0.024, 0.0625, 0.0650, 0.0858, n=2.3)],
            Cap(0.003, 0.06, 2),
            Cap(0.003, 0.06, 2),
            1,
            40,
        ),
    )
    yield (
        "Body_Torso",
        "ribs",
        "white",
        loft(
            [
                Section(0.078, 0.066, 0.069, 0.096, n=2.5),
                Section(0.110, 0.078, 0.078, 0.113, n=2.6),
                Section(0.140, 0.086, 0.083, 0.124, n=2.6),
            ],
            Cap(0.016, 0.22),
            Cap(0.006, 0.08, 3),
            6,
            44,
        ),
    )
    chest = Loft(
        [
            Section(0.147, 0.088, 0.084, 0.127, n=2.6),
            Section(0.190, 0.096, 0.089, 0.140, n=2.7),
            Section(0.240, 0.096, 0.092, 0.148, n=2.7),
            Section(0.280, 0.084, 0.086, 0.138, n=2.6),
            Section(0.310, 0.066, 0.071, 0.108, n=2.4),
            Section(0.334, 0.050, 0.055, 0.072, n=2.3),
        ],
        Cap(0.006, 0.08, 3),
        Cap(0.012, 0.35),
    )
    yield "Body_Torso", "chest", "white", chest.mesh(18, 48)
    yield "Body_Torso", "chest_plate", "graphite", chest.patch((0, 0.236), (24, 0.030), 0.002, n=3.4)
    yield "Body_Torso", "chest_light", "accent", chest.patch((0, 0.236), (15, 0.0055), 0.0036, n=4, rings=5)
    pack = Loft(
        [Section(0.100, 0.03, 0.030, 0.070, n=3.4), Section(0.285, 0.03, 0.034, 0.082, n=3.4)],
        Cap(0.02, 0.5),
        Cap(0.03, 0.6),
    )
    yield "Body_Torso", "backpack", "graphite", pack.mesh(8, 36).moved(x=-0.078)


def _head() -> Iterator[Part]:
    yield (
        "Body_Neck",
        "neck",
        "graphite",
        loft(
            [
                Section(-0.022, 0.043, 0.043, 0.045),
                Section(0.020, 0.033, 0.033, 0.033),
                Section(0.05, 0.03, 0.03, 0.03),
            ],
            Cap(0.006, 0.1, 2),
            Cap(0.010, 0.4),
            6,
            28,
        ),
    )
    yield "Body_HNP", "neck_joint", "steel", along("y", disc(0.021, 0.058, segments=24))
    skull = Loft(
        [
            Section(-0.014, 0.050, 0.048, 0.046, x=0.008, n=2.3),
            Section(0.024, 0.078, 0.066, 0.066, x=0.006, n=2.4),
            Section(0.064, 0.092, 0.083, 0.077, x=0.003, n=2.45),
            Section(0.104, 0.095, 0.093, 0.080, x=0.000, n=2.45),
            Section(0.140, 0.086, 0.089, 0.074, x=-0.001, n=2.4),
            Section(0.180, 0.054, 0.058, 0.050, x=-0.002, n=2.2),
        ],
        Cap(0.014, 0.5),
        Cap(0.014, 1.0, 5),
    )
    yield "Body_Head", "skull", "white", skull.mesh(22, 44)
    yield (
        "Body_Head",
        "visor",
        "visor",
        skull.patch((0, 0.088), (66, 0.042), 0.003, n=3.2, rings=9, segments=56),
    )
    eye = skull.patch((21, 0.094), (5.0, 0.0075), 0.0046, depth=0.001, n=2.2, rings=4, segments=24)
    yield "Body_Head", "eyes", "accent", joined(eye, eye.mirrored())
    ear = along("y", disc(0.027, 0.016, edge=0.005, dish=0.002, segments=28)).moved(
        x=-0.006, y=0.078, z=0.088
    )
    yield "Body_Head", "ears", "graphite", joined(ear, ear.mirrored())


def _leg(s: str, y: int) -> Iterator[Part]:
    yield f"Body_{s}HY", "hip_yaw", "graphite", disc(0.030, 0.04, edge=0.008, segments=24).moved(z=0.050)
    yield f"Body_{s}HR", "hip_ball", "graphite", ball(0.057, 0.052, 0.057, segments=24)
    hip_cap = along("y", disc(0.040, 0.024, edge=0.007, dish=0.003)).moved(y=0.050)
    yield f"Body_{s}HP", f"hip_cap_{s}", "steel", hip_cap if y > 0 else hip_cap.mirrored()
    thigh = Loft(
        [
            Section(-THIGH + 0.030, 0.044, 0.040, 0.040, x=0.002, n=2.6),
            Section(-THIGH + 0.075, 0.051, 0.044, 0.0455, x=0.004, n=2.5),
            Section(-0.140, 0.062, 0.054, 0.054, x=0.004, n=2.4),
            Section(-0.075, 0.065, 0.061, 0.058, x=0.002, n=2.4),
            Section(-0.022, 0.058, 0.056, 0.053, n=2.4),
        ],
        Cap(0.020, 0.45),
        Cap(0.030, 0.5),
    )
    yield f"Body_{s}HP", "thigh", "white", thigh.mesh(11, 34)
    yield (
        f"Body_{s}HP",
        "thigh_seam",
        "graphite",
        thigh.patch((0, -0.150), (4, 0.060), 0.0015, n=5, rings=5, segments=28),
    )
    yield f"Body_{s}KN", "knee", "graphite", along("y", disc(0.044, 0.078, edge=0.008))
    rim = along("y", disc(0.029, 0.008, edge=0.003, dish=0.002, segments=24)).moved(y=0.0395)
    yield f"Body_{s}KN", "knee_rim", "accent", joined(rim, rim.mirrored())
    shin = Loft(
        [
            Section(-SHIN + 0.030, 0.031, 0.030, 0.029, x=0.004, n=2.5),
            Section(-SHIN + 0.085, 0.035, 0.038, 0.034, x=0.002, n=2.4),
            Section(-0.150, 0.042, 0.056, 0.043, x=0.000, n=2.3),
            Section(-0.085, 0.047, 0.060, 0.048, x=0.000, n=2.3),
            Section(-0.026, 0.050, 0.040, 0.044, x=0.002, n=2.5),
        ],
        Cap(0.016, 0.45),
        Cap(0.016, 0.45),
    )
    yield f"Body_{s}KN", "shin", "white", shin.mesh(13, 34)
    yield (
        f"Body_{s}KN",
        "knee_cap",
        "white",
        loft(
            [
                Section(-0.050, 0.047, 0.030, 0.034, n=2.8),
                Section(-0.012, 0.0525, 0.030, 0.031, n=2.8),
                Section(0.032, 0.046, 0.020, 0.026, n=2.6),
            ],
            Cap(0.010, 0.4, 3),
            Cap(0.020, 0.7, 4),
            5,
            28,
        ),
    )
    yield f"Body_{s}AP", "ankle", "graphite", along("y", disc(0.031, 0.058, edge=0.007))
    upper = Loft(
        [
            Section(-0.070, 0.136, 0.066, 0.044, n=2.7),
            Section(-0.052, 0.130, 0.064, 0.043, n=2.6),
            Section(-0.028, 0.078, 0.054, 0.040, n=2.4),
            Section(-0.006, 0.046, 0.044, 0.036, n=2.3),
        ],
        Cap(0.004, 0.03, 2),
        Cap(0.012, 0.4),
    )
    yield f"Body_{s}AR", "foot", "white", upper.mesh(9, 36)
    yield (
        f"Body_{s}AR",
        "sole",
        "graphite",
        loft(
            [Section(-0.078, 0.140, 0.070, 0.047, n=2.8), Section(-0.062, 0.141, 0.071, 0.048, n=2.8)],
            Cap(0.006, 0.05, 3),
            Cap(0.005, 0.05, 2),
            2,
            40,
        ),
    )


def _arm(s: str, y: int) -> Iterator[Part]:
    socket = along("y", disc(0.049, 0.06, edge=0.012)).moved(y=-0.040)
    yield f"Body_{s}SP", f"shoulder_{s}", "graphite", socket if y > 0 else socket.mirrored()
    yield f"Body_{s}SR", "shoulder_ball", "graphite", ball(0.046, segments=22)
    cap = Loft(
        [
            Section(-0.040, 0.054, 0.054, 0.030, y=0.022, n=2.3),
            Section(0.010, 0.056, 0.056, 0.038, y=0.016, n=2.3),
            Section(0.056, 0.036, 0.036, 0.030, y=0.002, n=2.2),
        ],
        Cap(0.022, 0.6),
        Cap(0.022, 1.0, 5),
    ).mesh(12, 32)
    yield f"Body_{s}SR", f"shoulder_cap_{s}", "white", cap if y > 0 else cap.mirrored()
    yield (
        f"Body_{s}SY",
        "upper_arm",
        "white",
        loft(
            [
                Section(-UPPER_ARM + 0.026, 0.033, 0.033, 0.031, n=2.5),
                Section(-0.140, 0.038, 0.039, 0.036, n=2.4),
                Section(-0.070, 0.042, 0.042, 0.040, n=2.3),
                Section(-0.020, 0.038, 0.038, 0.037, n=2.3),
            ],
            Cap(0.014, 0.45),
            Cap(0.016, 0.5),
            9,
            30,
        ),
    )
    yield f"Body_{s}EB", "elbow", "graphite", along("y", disc(0.034, 0.060, edge=0.007))
    rim = along("y", disc(0.021, 0.007, edge=0.003, dish=0.002, segments=24)).moved(y=0.0305)
    yield f"Body_{s}EB", "elbow_rim", "accent", joined(rim, rim.mirrored())
    yield (
        f"Body_{s}EB",
        "forearm",
        "white",
        loft(
            [
                Section(-0.112, 0.034, 0.034, 0.032, n=2.4),
                Section(-0.070, 0.038, 0.037, 0.035, n=2.4),
                Section(-0.022, 0.034, 0.034, 0.031, n=2.4),
            ],
            Cap(0.005, 0.1, 2),
            Cap(0.014, 0.45),
            8,
            30,
        ),
    )
    # from here on z counts from the joint between the halves of the forearm
    yield f"Body_{s}WY", "wrist_ring", "graphite", disc(0.0305, 0.014, edge=0.003).moved(z=-0.004)
    yield (
        f"Body_{s}WY",
        "wrist_sleeve",
        "white",
        loft(
            [
                Section(0.108 - FOREARM + 0.018, 0.025, 0.025, 0.023, n=2.4),
                Section(-0.008, 0.034, 0.034, 0.032, n=2.4),
            ],
            Cap(0.010, 0.4),
            Cap(0.004, 0.1, 2),
            6,
            30,
        ),
    )
    yield f"Body_{s}WR", "wrist", "graphite", ball(0.022, segments=18)


def _hand(s: str, y: int) -> Iterator[Part]:
    side = "left" if y > 0 else "right"
    palm = Loft(
        [
            Section(-0.100, 0.037, 0.037, 0.0135, n=3.0),
            Section(-0.060, 0.039, 0.038, 0.0160, n=2.8),
            Section(-0.020, 0.026, 0.026, 0.0175, n=2.4),
        ],
        Cap(0.008, 0.4),
        Cap(0.012, 0.6),
    )
    yield f"Body_{s}WP", "palm", "graphite", palm.mesh(8, 28)
    back = palm.patch((90, -0.060), (62, 0.034), 0.0035, depth=0.003, n=2.8)
    yield f"Body_{s}WP", f"hand_back_{s}", "white", back if y > 0 else back.mirrored()
    for finger in FINGERS:
        for part, length, radius in (
            ("Proximal", 0.033, 0.0088),
            ("Medial", 0.025, 0.0082),
            ("Distal", 0.023, 0.0076),
        ):
            yield (
                f"{side}{finger}{part}",
                part.lower(),
                "steel" if part == "Proximal" else "graphite",
                loft(
                    [
                        Section(-length - 0.004, radius * 0.92, radius * 0.92, radius * 0.92),
                        Section(0.006, *(radius,) * 3),
                    ],
                    Cap(radius * 0.9, 1.0, 2),
                    Cap(radius * 0.9, 1.0, 2),
                    1,
                    12,
                ),
            )
