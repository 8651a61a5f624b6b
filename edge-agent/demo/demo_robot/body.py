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
    pelvis = Loft(
        [
            Section(-0.052, 0.036, 0.040, 0.020, x=0.002, n=2.4),
            Section(-0.010, 0.056, 0.062, 0.028, n=2.5),
            Section(0.030, 0.074, 0.080, 0.100, n=2.6),
            Section(0.062, 0.078, 0.084, 0.116, n=2.7),
            Section(0.096, 0.070, 0.076, 0.104, n=2.6),
        ],
        Cap(0.016),
        Cap(0.022, 0.5),
    )
    yield "Body_Hip", "pelvis", "white", pelvis.mesh(16, 40)
    yield (
        "Body_Hip",
        "pelvis_belt",
        "graphite",
        loft(
            [Section(0.070, 0.064, 0.068, 0.092), Section(0.122, 0.058, 0.062, 0.080)],
            Cap(0.004, 0.1, 1),
            Cap(0.010, 0.2),
            4,
            36,
        ),
    )
    yield "Body_Hip", "pelvis_plate", "graphite", pelvis.patch((0, 0.058), (26, 0.016), 0.0025)

    abdomen = [
        Section(0.000, 0.060, 0.062, 0.084, n=2.3),
        Section(0.040, 0.056, 0.060, 0.078, n=2.3),
        Section(0.130, 0.062, 0.066, 0.088, n=2.3),
    ]
    yield "Body_Torso", "abdomen", "graphite", loft(abdomen, Cap(0.010, 0.2), Cap(0.01, 0.2, 2), 8, 36)
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
    chest = Loft(
        [
            Section(0.072, 0.062, 0.064, 0.092, n=2.5),
            Section(0.120, 0.080, 0.080, 0.116, n=2.6),
            Section(0.190, 0.096, 0.090, 0.140, n=2.7),
            Section(0.250, 0.094, 0.092, 0.148, n=2.7),
            Section(0.296, 0.074, 0.080, 0.126, n=2.5),
            Section(0.330, 0.050, 0.056, 0.074, n=2.3),
        ],
        Cap(0.020, 0.55),
        Cap(0.014, 0.45),
    )
    yield "Body_Torso", "chest", "white", chest.mesh(22, 48)
    yield "Body_Torso", "chest_plate", "graphite", chest.patch((0, 0.232), (24, 0.034), 0.002, n=3.4)
    yield "Body_Torso", "chest_light", "accent", chest.patch((0, 0.232), (15, 0.0065), 0.0036, n=4, rings=5)
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
            Section(-0.012, 0.046, 0.050, 0.044, x=0.010, n=2.4),
            Section(0.030, 0.078, 0.066, 0.065, x=0.008, n=2.5),
            Section(0.085, 0.094, 0.090, 0.079, x=0.002, n=2.5),
            Section(0.130, 0.088, 0.092, 0.077, x=0.000, n=2.4),
            Section(0.178, 0.050, 0.056, 0.048, x=-0.002, n=2.2),
        ],
        Cap(0.014, 0.6),
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
    yield f"Body_{s}HY", "hip_yaw", "graphite", disc(0.046, 0.05, edge=0.01).moved(z=0.045)
    yield f"Body_{s}HR", "hip_ball", "graphite", ball(0.057, 0.052, 0.057)
    hip_cap = along("y", disc(0.043, 0.026, edge=0.007, dish=0.003)).moved(y=0.049)
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
    yield f"Body_{s}HP", "thigh", "white", thigh.mesh(16, 36)
    yield f"Body_{s}HP", "thigh_plate", "graphite", thigh.patch((0, -0.150), (22, 0.062), 0.002, n=3.0)
    yield f"Body_{s}KN", "knee", "graphite", along("y", disc(0.044, 0.078, edge=0.008))
    rim = along("y", disc(0.029, 0.008, edge=0.003, dish=0.002, segments=28)).moved(y=0.0395)
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
    yield f"Body_{s}KN", "shin", "white", shin.mesh(18, 36)
    knee_cap = Loft(
        [Section(-0.040, 0.050, 0.030, 0.036, n=2.6), Section(0.034, 0.050, 0.030, 0.033, n=2.4)],
        Cap(0.004),
        Cap(0.004),
    )
    yield (
        f"Body_{s}KN",
        "knee_cap",
        "white",
        knee_cap.patch((0, -0.004), (52, 0.034), 0.003, depth=0.012, n=2.6),
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
    yield f"Body_{s}AR", "foot", "white", upper.mesh(12, 40)
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
    yield f"Body_{s}SR", "shoulder_ball", "graphite", ball(0.046)
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
            14,
            32,
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
            32,
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
            32,
        ),
    )
    yield f"Body_{s}WR", "wrist", "graphite", ball(0.022, segments=22)


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
                    Cap(radius * 0.9, 1.0, 3),
                    Cap(radius * 0.9, 1.0, 3),
                    1,
                    14,
                ),
            )
