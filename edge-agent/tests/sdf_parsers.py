"""The parser of SDF, with the worst input that is known."""

from __future__ import annotations

from pathlib import Path

from parser_stage import Input, Parser, Work, Worst, written
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.sdf.reader import load_sdf, read_sdf
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.tree import build_tree

WHOLE = b"""<sdf version="1.9"><model name="m" placement_frame="f"><pose>0 0 1 0 0 0</pose>
<link name="a"><pose relative_to="f">1 0 0 0 0 0.5</pose>
<inertial><mass>1</mass><inertia><ixx>1</ixx></inertia></inertial>
<visual name="v"><pose>0 0 1 0 0 0</pose>
<geometry><mesh><uri>a.stl</uri><scale>1 1 1</scale></mesh></geometry>
<material><diffuse>1 0 0 1</diffuse></material><transparency>0.5</transparency></visual>
<collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry></collision>
<sensor name="s" type="imu"><pose>0 0 1 0 0 0</pose></sensor></link>
<link name="b"><pose degrees="true">0 1 0 0 0 90</pose></link><link name="c"/>
<frame name="f" attached_to="b"><pose>0 0 0.5 0 0 0</pose></frame>
<joint name="j" type="revolute"><parent>a</parent><child>b</child><pose>0 0 0.1 0 0 0</pose>
<axis><xyz expressed_in="__model__">0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit>
<mimic joint="k"><multiplier>2</multiplier></mimic></axis></joint>
<joint name="k" type="universal"><parent>b</parent><child>n::c</child><axis/><axis2/></joint>
<joint name="l" type="ball"><parent>c</parent><child>a</child></joint>
<model name="n"><pose relative_to="a">0 0 0 0 0 0</pose><link name="c"/></model>
<include><uri>b.sdf</uri><name>o</name><pose>0 0 0 0 0 0</pose></include></model></sdf>"""
LEAF = b"<sdf version='1.9'><model name='leaf'><link name='a'/></model></sdf>"


def sdf_work(given: Input, folder: Path) -> Work:
    """Read, hung together, examined."""

    def work() -> None:
        urdf = read_sdf(given.data)
        examine_model(urdf, build_tree(urdf), {})

    return work


def including_work(given: Input, folder: Path) -> Work:
    """With the files that it includes."""
    path = written(given, folder, "robot.sdf")
    return lambda: load_sdf(path, Resolver(path))


def model(inside: str) -> bytes:
    return f"<sdf version='1.9'><model name='m'><link name='a'/>{inside}</model></sdf>".encode()


def joint(number: int, parent: str, child: str) -> str:
    return f"<joint name='j{number}' type='fixed'><parent>{parent}</parent><child>{child}</child></joint>"


def frames(n: int, first: str) -> str:
    """Each attached to the one before."""
    return f"<frame name='f0' {first}/>" + "".join(
        f"<frame name='f{i}' attached_to='f{i - 1}'/>" for i in range(1, n)
    )


def asked_of_the_last(n: int, first: str) -> bytes:
    """A chain of frames, and as many joints that ask where it leads."""
    return model(frames(n, first) + "".join(joint(i, f"f{n - 1}", "a") for i in range(n)))


def links(n: int) -> bytes:
    """In a chain, each placed relative to the one before."""
    made = (f"<link name='l{i}'><pose relative_to='l{i - 1}'>1 0 0 0 0 0</pose></link>" for i in range(1, n))
    joints = (joint(i, f"l{i - 1}", f"l{i}") for i in range(1, n))
    return model("<link name='l0'/>" + "".join(made) + "".join(joints))


def nested(n: int) -> bytes:
    """Models side by side, each placed by a frame of its own."""
    inner = "<model name='n{}' placement_frame='l'><link name='l'/></model>"
    return model("".join(inner.format(i) for i in range(n)))


def included(n: int) -> Input:
    """One file, again and again."""
    one = "<include><uri>leaf.sdf</uri><name>n{}</name></include>"
    return Input(model("".join(one.format(i) for i in range(n))), {"leaf.sdf": LEAF})


REFUSED = (ModelRefused,)
VALUES = ("numbers", "number", "vector", "pose", "name")
PARSERS = (
    Parser(
        "sdf",
        (
            "model.sdf.reader.read_sdf",
            *(f"model.sdf.values.SdfValues.read_{what}" for what in VALUES),
            "model.sdf.shapes.ShapeReader.read",
            "model.sdf.shapes.ShapeReader.read_inertial",
            "model.sdf.joints.JointReader.read",
            "model.urdf.reader.parse_floats",
        ),
        sdf_work,
        REFUSED,
        (WHOLE,),
        {
            "frames in a chain": Worst(lambda n: asked_of_the_last(n, "attached_to='a'"), 100),
            "frames that lead nowhere": Worst(lambda n: asked_of_the_last(n, "attached_to='gone'"), 100),
            "frames in a circle": Worst(lambda n: asked_of_the_last(n, f"attached_to='f{n - 1}'"), 100),
            "links in a chain": Worst(links, 60),
            "models side by side": Worst(nested, 60),
            "models of one name": Worst(
                lambda n: b"<sdf>" + b"<model name='n'><link name='a'/></model>" * n + b"</sdf>", 60
            ),
            "joints of one name": Worst(lambda n: model(joint(1, "a", "a") * n), 200),
            "loops": Worst(lambda n: model("".join(joint(i, "a", "world") for i in range(n))), 200),
            "texts": Worst(lambda n: model("<a>x</a>" * n), 1000),
            "a long number": Worst(lambda n: model(f"<pose>{'1' * n}</pose>"), 50_000),
        },
    ),
    Parser(
        "sdf-included",
        ("model.sdf.reader.load_sdf", "model.sdf.includes.IncludeReader.read_main"),
        including_work,
        REFUSED,
        (WHOLE,),
        {"includes": Worst(included, 12)},
    ),
)
