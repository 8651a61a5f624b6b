from __future__ import annotations

import math
from pathlib import Path

import pytest
from command_stage import run_edge
from edge_stage import PROFILE
from posecast_edge.profile.reader import (
    ERRORS_MAX,
    READ_BYTES_MAX,
    ProfileError,
    TermError,
    find_profile,
    load_profile,
    parse_profile,
    resolve_entries,
)
from posecast_edge.profile.schema import make_schema_text
from posecast_wire.schema import JointMap, Schema, SensorMount, Sentence, Threshold
from settings_parsers import BASE, VIEWS


def test_a_whole_profile() -> None:
    p = parse_profile(PROFILE)
    assert p.name == "two-joints"
    assert [(f.name, f.label_set, f.unit, f.scale, f.rel, f.bits) for f in p.fields] == [
        ("ref", "joint", "rad", 0.001, None, ()),
        ("pos", "joint", "rad", 0.001, "ref", ()),
        ("ftf", "ftf", "N", 1.0, None, ()),
        ("flags", "joint", "", 1.0, None, ("homed", "jam", "hot")),
    ]
    assert p.labels == {"joint": ("RKN", "LKN"), "ftf": ("RF.fz",)}
    m = p.mapping
    assert m.joints == {"KNEE": JointMap((("RKN", 2.0), ("LKN", -1.0)), math.pi / 2)}
    assert m.sensors == {"RF": SensorMount("wrench", "RF", "foot", (0.0, 0.0, -0.1), (0.0, 0.0, 0.0))}
    assert m.thresholds == {"ftf": {"RF.fz": Threshold(-30.0, 500.0, 0.5)}}
    assert m.severities == {"flags": {"homed": "state", "hot": "caution"}}
    assert m.tolerances == {"*": 0.05}
    assert m.names == {"RKN": "right knee", "RF": "right foot"}


FLAGS = BASE + "[[fields]]\nname='flags'\nbits=['jam']\n"


def test_a_bit_has_sentences_by_language() -> None:
    p = parse_profile(
        FLAGS + "[explain.flags]\njam.en = { say = '{joint} is stuck[: {error} off].', why = 'It hit.' }\n"
        "jam.ko.say = '{joint}: 막힘'\n[views.lab]\nfields = ['pos']\n"
    )
    told = {
        "jam": {
            "en": Sentence("{joint} is stuck[: {error} off].", "It hit."),
            "ko": Sentence("{joint}: 막힘"),
        }
    }
    assert p.mapping.sentences == {"flags": told}
    assert Schema.parse(make_schema_text(p)).mapping.sentences == {"flags": told}
    assert "explain" not in make_schema_text(p.restrict_to_view(p.views["lab"])), "of a field not in the view"


def test_names_are_given_by_language_too() -> None:
    p = parse_profile(
        BASE + "[[fields]]\nname='volt'\nlabels=['V']\n[names]\nA='waist'\n[names.ko]\nA='허리'\nV='배터리'\n"
        "[names.fa]\nA='کمر'\n[views.lab]\nfields=['volt']\n"
    )
    assert p.mapping.names == {"A": "waist"}
    translated = {"ko": {"A": "허리", "V": "배터리"}, "fa": {"A": "کمر"}}
    assert Schema.parse(make_schema_text(p)).mapping.translated_names == translated
    seen = Schema.parse(make_schema_text(p.restrict_to_view(p.views["lab"])))
    assert seen.mapping.translated_names == {"ko": {"V": "배터리"}}, "of what the view has"


MARKED = "نیم\u200cساق ශ්\u200dරී \u200eB\u200f"  # as Persian, Sinhala and mixed directions are written


def test_words_for_people_have_the_joiners_and_marks_of_their_script() -> None:
    p = parse_profile(
        FLAGS + f"[explain.flags]\njam.fa = {{ say = '{MARKED}', why = '{MARKED}' }}\n"
        f"[names]\nA = '{MARKED}'\n[robot]\nname = '{MARKED}'\n"
        f"[sensors]\nS = {{ kind = 'imu', name = '{MARKED}' }}\n"
    )
    schema = Schema.parse(make_schema_text(p))
    assert schema.robot == MARKED
    assert schema.mapping.names == {"A": MARKED}
    assert schema.mapping.sensors["S"].name == MARKED
    assert schema.mapping.sentences["flags"]["jam"]["fa"] == Sentence(MARKED, MARKED)


# Every text for people that a profile may give, with a gap for it, and where a complaint says that it stands.
TEXTS = [
    ("[explain.flags.jam]\nfa.say = {}\n", "p.toml:9: explain.flags.jam.fa.say"),
    ("[explain.flags.jam]\nfa = {{ say = 'x', why = {} }}\n", "p.toml:9: explain.flags.jam.fa.why"),
    ("[names]\nA = {}\n", "p.toml:9: names.A"),
    ("[robot]\nname = {}\n", "p.toml:9: robot.name"),
]


@pytest.mark.parametrize(
    "unseen", "\u00ad\u200b\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\ufeff\u2028\u0085"
)
@pytest.mark.parametrize(("table", "where"), TEXTS)
def test_other_unseen_letters_are_refused_also_beside_them(table: str, where: str, unseen: str) -> None:
    with pytest.raises(ProfileError) as caught:
        parse_profile(FLAGS + table.format(f'"a\u200cb\\u{ord(unseen):04x}"'), "p.toml")
    assert str(caught.value).startswith(f"{where}: must be a text, not 'ab")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("blank", [" ", "   ", "\\t", "\\n", "\\u00a0", "\\u200c\\u200f", " \\u3164\\u2800"])
@pytest.mark.parametrize(("table", "where"), TEXTS)
def test_words_that_are_blank_are_refused(table: str, where: str, blank: str) -> None:
    with pytest.raises(ProfileError) as caught:
        parse_profile(FLAGS + table.format(f'"{blank}"'), "p.toml")
    assert str(caught.value).startswith(f"{where}: must not be blank, not '")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = ", ": Invalid value (at end of document)"),
        ("", ": fields: at least one [[fields]] is needed"),
        (BASE + "[robott]\n", ":5: robott: unknown key"),
        (BASE + "[robot]\nname='x'\ncolour='red'\n", ":7: robot.colour: unknown key; known: name, root"),
        (BASE + "unt='rad'\n", ":5: fields[0].unt: unknown key"),
        (BASE + "unit='furlong'\n", ":5: fields.pos.unit: unknown unit 'furlong'"),
        (BASE + "labels='joints'\n", ":5: fields.pos.labels: unknown label set 'joints'"),
        (BASE + "labels=['C','C']\n", ":5: fields.pos.labels[1]: 'C' is listed twice"),
        (BASE + "scale=0\n", ":5: fields.pos.scale: must be above 0, not 0"),
        (BASE + "scale='big'\n", ":5: fields.pos.scale: must be a number, not 'big'"),
        (BASE + "deadband=-1\n", ":5: fields.pos.deadband: must be at least 0, not -1"),
        (BASE + "rel='vel'\n", ":5: fields.pos.rel: 'vel' is not an earlier field"),
        (BASE + "slow=1\n", ":5: fields.pos.slow: must be true or false, not 1"),
        (BASE + "[[fields]]\nname='pos'\n", ":6: fields[1].name: 'pos' is listed twice"),
        (BASE + "[[fields]]\nname='a b'\n", ":6: fields[1].name: 'a b' must be"),
        (BASE + "[joints.K]\nterms=[['C',1]]\n", ":6: joints.K.terms[0]: unknown joint 'C'"),
        (
            BASE + "[joints.K]\nterms=[['A',1]]\n[joints.L]\nterms=[['A',2]]\n",
            ":8: joints.L.terms[0]: channel 'A' already moves joint 'K'; for a joint that moves",
        ),
        (BASE + "[joints]\nK.terms=[['L',1]]\nL.terms=[['K',1]]\n", ":6: joints.K: a loop: K → L → K"),
        (BASE + "units={A='inch'}\n", ":5: fields.pos.units.A: unknown unit 'inch'"),
        (BASE + "units={C='mm'}\n", ":5: fields.pos.units.C: unknown label 'C'"),
        (BASE + "[views.Lab]\n", ":5: views.Lab: view 'Lab': use 1 to 63 of a-z"),
        (BASE + "[views.lab]\nfields=['pos','cur']\n", ":6: views.lab.fields[1]: unknown field 'cur'"),
        (BASE + "[views.lab]\nhz=0\n", ":6: views.lab.hz: must be at least 0.1, not 0"),
        (BASE + "[views.lab]\nrate=5\n", ":6: views.lab.rate: unknown key; known: fields, hz, scales, info"),
        (BASE + "[views.lab]\ninfo='mode'\n", ":6: views.lab.info: must be a list of texts"),
        (BASE + "[views.lab.scales]\nvel=1\n", ":6: views.lab.scales.vel: unknown field of this view 'vel'"),
        (
            BASE + "[[fields]]\nname='flags'\nbits=['jam']\n[views.lab.scales]\nflags=2\n",
            ":9: views.lab.scales.flags: a field of bits has no scale",
        ),
        (BASE + "[joints.K]\nterms=[['A']]\n", ":6: joints.K.terms[0]: must be [channel, gain]"),
        (BASE + "[joints.K]\nterms=[['A',nan]]\n", ":6: joints.K.terms[0]: must be a number"),
        (BASE + "[joints.A]\noffset_deg=1\noffset_rad=1\n", ":5: joints.A: give offset_rad or offset_deg"),
        (BASE + "[sensors.RF]\nkind='nose'\n", ":6: sensors.RF.kind: unknown kind 'nose'"),
        (BASE + "[sensors.RF]\nkind='imu'\nxyz=[1,2]\n", ":7: sensors.RF.xyz: must be three numbers"),
        (BASE + "[severity.pos]\njam='fault'\n", ":6: severity.pos.jam: unknown bit 'jam'"),
        (FLAGS + "[explain.pos]\njam.en.say='x'\n", ":9: explain.pos.jam: unknown bit 'jam'"),
        (FLAGS + "[explain.flags]\nhot.en.say='x'\n", ":9: explain.flags.hot: unknown bit 'hot'"),
        (
            FLAGS + "[explain.flags.jam]\nenglish.say='x'\n",
            ":9: explain.flags.jam.english: must be a language tag, such as en or ko",
        ),
        (
            FLAGS + "[explain.flags.jam]\nen={say='x',text='y'}\n",
            ":9: explain.flags.jam.en.text: unknown key; known: say, why",
        ),
        (
            FLAGS + "[explain.flags.jam]\nen={why='y'}\n",
            ":9: explain.flags.jam.en.say: must be a text, not None",
        ),
        (
            FLAGS + "[explain.flags.jam]\nen.say='{motor} is hot'\n",
            ":9: explain.flags.jam.en.say: unknown place {motor}; known: joint, age, ref, pos, error",
        ),
        (
            FLAGS + "[explain.flags.jam]\nen.say='{joint} {temp}'\n",
            ":9: explain.flags.jam.en.say: {temp} may be unknown: put its part",
        ),
        (
            FLAGS + "[explain.flags.jam]\nen.say='{joint} [is [hot]]'\n",
            ":9: explain.flags.jam.en.say: braces and brackets must come in pairs",
        ),
        (
            FLAGS + f"[explain.flags.jam]\nen.say='{'x' * 201}'\n",
            ":9: explain.flags.jam.en.say: has 201 characters; at most 200",
        ),
        (
            FLAGS + "[explain.flags.jam]\n" + "".join(f"a{chr(97 + i)}.say='x'\n" for i in range(17)),
            ":25: explain.flags.jam.aq: more than 16 languages",
        ),
        (
            BASE
            + f"[[fields]]\nname='flags'\nbits={[f'b{i}' for i in range(12)]}\n"
            + "".join(
                f"[explain.flags.b{i}]\n" + "".join(f"a{chr(97 + k)}.say='{'모' * 200}'\n" for k in range(5))
                for i in range(12)
            ),
            ":68: explain.flags.b10: more than 32768 bytes of sentences in all",
        ),
        (BASE + "[thresholds.temp]\nA={high=1}\n", ":5: thresholds.temp: unknown field 'temp'"),
        (BASE + "[thresholds.pos]\nC={high=1}\n", ":6: thresholds.pos.C: unknown label 'C'"),
        (BASE + "[thresholds.pos]\nA={}\n", ":6: thresholds.pos.A: give low, high or both"),
        (BASE + "[thresholds.pos]\nA={low=2,high=1}\n", ":6: thresholds.pos.A: low 2 is not below high 1"),
        (BASE + "[tolerance]\nC=1\n", ":6: tolerance.C: unknown joint 'C'"),
        (BASE + "deadband=1e7\n", ":5: fields.pos.deadband: must be at most 1e+06, not 1e+07"),
        (BASE + "scale=1e-13\n", ":5: fields[0].scale: must lie between 1e-12 and 1e12"),
        (BASE + "scale=" + "9" * 350 + "\n", ":5: fields.pos.scale: must be a number, not 99999"),
        (BASE + "scale=1e999\n", ":5: fields.pos.scale: must be a number, not inf"),
        (BASE + "scale=" + "9" * 5000 + "\n", ":5: a number of more than 400 digits"),
        (BASE + "x=" + "[" * 20000 + "\n", ": nested too deep"),
        (BASE + "x=" + "[" * 200 + "]" * 200 + "\n", ":5: fields[0].x: unknown key"),
        (BASE + "a." * 40 + "b=1\n", ":5: a key of more than 32 parts"),
        (BASE + "unit=[1]\n", ":5: fields.pos.unit: unknown unit [1]"),
        (BASE + "labels=5\n", ":5: fields.pos.labels: must be a list of texts"),
        (BASE + "rel=['ref']\n", ":5: fields.pos.rel: ['ref'] is not an earlier field"),
        (BASE + "scale=1979-05-27\n", ":5: fields.pos.scale: must be a number, not datetime.date"),
        (BASE + "x=9999-99-99\n", ": "),
        (BASE + f"[names]\nA='{'x' * 300}'\n", ":6: names.A: must be a text of 1 to 200 characters"),
        (BASE + "'a\\u202eb'=1\n", ":5: fields[0].a\\u202eb: unknown key"),
        (BASE + "".join(f"[views.v{i}]\n" for i in range(9)), ":13: views.v8: more than 8 views"),
        (
            BASE + "".join(f"[[fields]]\nname='f{i}'\nlabels='joint'\n" for i in range(3000)),
            ":6146: fields[2048]: more than 4096 channels in all",
        ),
        (
            BASE
            + "[joints]\n"
            + "".join(f"j{i}.terms=[['j{i + 1}',1]]\n" for i in range(5000))
            + "j5000.terms=[['A',1]]\n",
            ":6: joints.j0: a chain of more than 32 joints that follow one another",
        ),
        (
            BASE + "[trajectory]\ncolumns=['A']\nrate_hz=1\nheader=-1\n",
            ":8: trajectory.header: must be an integer from",
        ),
        (BASE + "[ros]\ndomain=true\n", ":6: ros.domain: must be an integer from 0 to 232, not True"),
        (BASE + "[names]\nC='c'\n", ":6: names.C: unknown channel or site 'C'"),
        (BASE + "[names]\nA=''\n", ":6: names.A: must be a text"),
        (BASE + "[names.ko]\nC='c'\n", ":6: names.ko.C: unknown channel or site 'C'"),
        (BASE + "[names.ko]\nA=' '\n", ":6: names.ko.A: must not be blank, not ' '"),
        (BASE + "[names.ko]\nA=5\n", ":6: names.ko.A: must be a text, not 5"),
        (BASE + "[names]\nA.x='y'\n", ":6: names.A: must be a language tag, such as en or ko"),
        (
            BASE + "[names]\n" + "".join(f"a{chr(97 + i)}.A='x'\n" for i in range(17)),
            ":22: names.aq: more than 16 languages",
        ),
        (BASE + "[trajectory]\ncolumns=['A']\n", ":5: trajectory.rate_hz: must be a number, not None"),
        (BASE + "[trajectory]\ncolumns=['C']\nrate_hz=1\n", ":6: trajectory.columns[0]: unknown"),
    ],
)
def test_a_mistake_is_named_with_file_and_place(text: str, message: str) -> None:
    with pytest.raises(ProfileError) as caught:
        parse_profile(text, "p.toml")
    assert str(caught.value).startswith("p.toml" + message)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 700


def test_a_file_that_is_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="No such file"):
        load_profile(tmp_path / "x.toml")
    (tmp_path / "y.toml").write_bytes(b"# more\na = '\xff'")
    with pytest.raises(ProfileError, match=r"y.toml:2: byte 12: not UTF-8"):
        load_profile(tmp_path / "y.toml")
    with pytest.raises(ProfileError, match="Is a directory"):
        load_profile(tmp_path)
    (tmp_path / "z.toml").write_bytes(b"#" * 2_000_000)
    with pytest.raises(ProfileError, match="over 1048576 bytes"):
        load_profile(tmp_path / "z.toml")
    long = "x" * 5000
    with pytest.raises(ProfileError, match="too long"):
        load_profile(find_profile(long))


def test_a_file_as_editors_on_windows_write_it(tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_bytes(b"\xef\xbb\xbf" + PROFILE.replace("\n", "\r\n").encode())
    assert load_profile(tmp_path / "p.toml") == parse_profile(PROFILE)


def test_every_profile_in_the_package_parses_and_makes_a_schema() -> None:
    files = sorted((Path(__file__).parents[1] / "src/posecast_edge/profiles").glob("*.toml"))
    assert files
    for file in files:
        assert Schema.parse(make_schema_text(load_profile(file))).size > 0


def test_a_joint_may_follow_a_joint_and_a_channel_have_a_unit_of_its_own() -> None:
    p = parse_profile(
        BASE + "units={B='mm'}\n[joints]\nk1={terms=[['A',2]],offset_rad=1}\nk2.terms=[['k1',0.5]]\n"
    )
    assert p.mapping.joints == {"k1": JointMap((("A", 2.0),), 1.0), "k2": JointMap((("A", 1.0),), 0.5)}
    assert p.mapping.find_unit("pos", "B") == "mm"
    assert p.mapping.find_unit("pos", "A") is None
    assert Schema.parse(make_schema_text(p)).mapping.find_unit("pos", "B") == "mm"


def test_a_view_holds_nothing_of_what_is_not_in_it() -> None:
    p = parse_profile(PROFILE + VIEWS)
    public, lab = (p.restrict_to_view(p.views[name]) for name in ("public", "lab"))
    assert (p.views["public"].hz, p.views["lab"].hz) == (10, None)
    text = make_schema_text(public)
    assert not [word for word in ("ftf", "RF", "foot", "500", '"ref"', '"rel"') if word in text], text
    schema = Schema.parse(text)
    assert [(f.name, f.scale, f.rel) for f in schema.fields] == [("pos", 0.01, None), ("flags", 1, None)]
    assert schema.mapping.joints == p.mapping.joints
    assert schema.mapping.names == {"RKN": "right knee"}
    assert make_schema_text(lab) == make_schema_text(p)


@pytest.mark.parametrize(
    ("view", "texts"),
    [
        ("fields = ['pos']", ()),  # who picks fields picks texts as well
        ("fields = ['pos']\ninfo = ['mode']", ("mode",)),
        ("hz = 10", None),
        ("info = []", ()),
    ],
)
def test_a_view_has_the_texts_that_it_names(view: str, texts: tuple[str, ...] | None) -> None:
    p = parse_profile(f"{PROFILE}[views.public]\n{view}\n")
    assert p.restrict_to_view(p.views["public"]).info == texts


def test_a_view_without_joints_tells_nothing_of_the_body() -> None:
    p = parse_profile(PROFILE + '[views.force]\nfields = ["ftf"]\n')
    schema = Schema.parse(make_schema_text(p.restrict_to_view(p.views["force"])))
    assert (schema.mapping.joints, schema.mapping.tolerances, schema.mapping.severities) == ({}, {}, {})
    assert set(schema.mapping.sensors) == {"RF"}


def test_a_profile_that_comes_along_is_found_by_its_name(tmp_path: Path) -> None:
    assert load_profile(find_profile("hubo2plus")).name == "Hubo 2+"
    assert find_profile(str(tmp_path / "hubo2plus")) == tmp_path / "hubo2plus"
    assert find_profile("../profiles/hubo2plus") == Path("../profiles/hubo2plus")
    with pytest.raises(
        ProfileError, match=r"No such file.*built-in profiles: arm, demo, drchubo, g1, hubo2plus"
    ):
        load_profile(find_profile("hubo3"))


# --- everything that is wrong with a profile is told at once

WRONG = """\
[labels]
joint = ["hip", "knee"]

[[fields]]
name = "pos"
unit = "radd"
deadband = -1

[[fields]]
name = "flags"
labels = "joint"
bits = ["over", "over"]

[sensors]
imu = { kind = "imo", xyz = [0, "a", 0] }

[severity.flags]
over = "bad"

[thresholds.pos]
knee = { warning = 1 }

[tolerance]
kne = 0.1
"""
PLACES = [
    "fields.flags.bits[1]",
    "fields.pos.deadband",
    "fields.pos.unit",
    "sensors.imu.kind",
    "thresholds.pos.knee.warning",
    "tolerance.kne",
]


def errors(text: str) -> list[str]:
    """All lines, without the file's name."""
    with pytest.raises(ProfileError) as caught:
        parse_profile(text, "p")
    return [line.removeprefix("p:") for line in caught.value.lines]


def test_all_of_them_with_their_lines() -> None:
    places = [line.partition(": ")[2].partition(": ")[0] for line in errors(WRONG)]
    assert sorted(places) == PLACES
    lines = {line.partition(": ")[2].partition(": ")[0]: line.partition(":")[0] for line in errors(WRONG)}
    assert (lines["fields.pos.unit"], lines["fields.pos.deadband"], lines["tolerance.kne"]) == (
        "6",
        "7",
        "24",
    )


def test_what_only_follows_is_not_told() -> None:
    text = WRONG.replace('unit = "radd"\ndeadband = -1\n', "").replace("imo", "imu").replace('"a"', "0")
    assert [line for line in errors(text) if "severity" in line] == []


@pytest.mark.parametrize("text", ["", "fields = 3", "[[fields]]", "[[fields]]\nname = 1", "fields = [1]"])
def test_where_nothing_can_be_taken_out_one_is_all(text: str) -> None:
    assert len(errors(text)) == 1


def test_there_is_an_end() -> None:
    text = "[[fields]]\nname = 'x'\n" + "".join(f"key{n} = 1\n" for n in range(100))
    assert len(errors(text)) == ERRORS_MAX
    assert len(errors(text + "#" * READ_BYTES_MAX)) == 1


def test_the_commands_print_each(tmp_path: Path) -> None:
    profile = tmp_path / "robot.toml"
    profile.write_text(WRONG)
    told = {
        run_edge(*argv, "--profile", str(profile)).stderr
        for argv in (
            ("doctor",),
            ("probe", "demo"),
            ("run", "--robot", "r", "--source", "demo", "--relay", "tcp/a:1"),
        )
    }
    assert len(told) == 1
    assert [line.startswith(f"posecast-edge: {profile}:") for line in told.pop().splitlines()] == [
        True
    ] * len(PLACES)


# --- joint mapping


def joint(*terms: tuple[str, float], offset: float = 0.0) -> JointMap:
    return JointMap(terms, offset)


def test_a_joint_that_follows_a_joint_ends_at_channels() -> None:
    entries = {
        "k3": joint(("k2", 0.5), offset=0.25),
        "k1": joint(("M", 2.0), offset=1.0),
        "k2": joint(("k1", 3.0), ("N", 1.0)),
    }
    assert resolve_entries(entries, ["M", "N"]) == {
        "k3": joint(("M", 3.0), ("N", 0.5), offset=1.75),
        "k1": joint(("M", 2.0), offset=1.0),
        "k2": joint(("M", 6.0), ("N", 1.0), offset=3.0),
    }


def test_a_name_that_is_both_means_the_channel() -> None:
    entries = {"A": joint(("A", 1.0), offset=0.5), "B": joint(("A", 1.0), ("C", 1.0))}
    assert resolve_entries(entries, ["A", "C"]) == entries


def test_differential_drives_share_channels() -> None:
    entries = {"pitch": joint(("L", 1.0), ("R", 1.0)), "roll": joint(("L", -1.0), ("R", 1.0))}
    assert resolve_entries(entries, ["L", "R"]) == entries


@pytest.mark.parametrize(
    ("entries", "where", "reason"),
    [
        ({"a": joint(("x", 1.0))}, ("a", 0), "unknown joint 'x'"),
        ({"a": joint(("a", 1.0))}, ("a", None), "a loop: a → a"),
        (
            {"a": joint(("b", 1.0)), "b": joint(("c", 1.0), ("M", 1.0)), "c": joint(("b", 1.0))},
            ("b", None),
            "a loop: b → c → b",
        ),
        (
            {"a": joint(("M", 1.0)), "b": joint(("M", -1.0))},
            ("b", 0),
            "channel 'M' already moves joint 'a'; for a joint that moves with it, use 'a' as the term",
        ),
    ],
)
def test_what_cannot_be(entries: dict[str, JointMap], where: tuple[str, int | None], reason: str) -> None:
    with pytest.raises(TermError) as caught:
        resolve_entries(entries, ["M"])
    assert (caught.value.joint, caught.value.term) == where
    assert caught.value.reason == reason
