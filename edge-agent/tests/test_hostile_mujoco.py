"""Models that make MuJoCo hang, crash or fill the memory, or its clock stand still: one line."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.registry import open_source

pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from posecast_edge.sources.mujoco import source as mujoco_trial
from posecast_edge.sources.mujoco.model import load_simulation

BODY = '<body pos="0 0 1"><joint name="j"/><geom size=".1" mass="1"/></body>'


def mjcf(inside: str = BODY, head: str = "", tail: str = "") -> str:
    return f"<mujoco>{head}<worldbody>{inside}</worldbody>{tail}</mujoco>"


def model(folder: Path, text: str) -> Path:
    path = folder / "a.xml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    return path


REFUSED = {
    "no time": (mjcf(head='<option timestep="0"/>'), "the timestep is 0 s"),
    "time that goes back": (mjcf(head='<option timestep="-1"/>'), "the timestep is -1 s"),
    "a moment": (mjcf(head='<option timestep="1e-300"/>'), "the timestep is 1e-300 s"),
    "all time": (mjcf(head='<option timestep="1e300"/>'), "the timestep is 1e+300 s"),
    "time that is none": (mjcf(head='<option timestep="nan"/>'), "the timestep is nan s"),
    "in itself": ('<mujoco><include file="a.xml"/></mujoco>', "already included"),
    "deep": (mjcf("<body>" * 5000 + BODY + "</body>" * 5000), "too deep"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_models_that_are_refused(case: str, tmp_path: Path) -> None:
    text, reason = REFUSED[case]
    with pytest.raises(SourceError) as refused:
        load_simulation(model(tmp_path, text))
    assert reason in str(refused.value)
    assert str(refused.value).startswith(f"{tmp_path}/a.xml:")
    assert "\n" not in str(refused.value)


TRIED = {
    "a replica": mjcf('<replicate count="100000000"><geom size=".1"/></replicate>' + BODY),
    "keys by the billion": mjcf(head='<size nkey="1000000000"/>'),
    "heights": mjcf(head='<asset><hfield name="h" nrow="50000" ncol="50000" size="1 1 1 1"/></asset>'),
    "a grid": mjcf('<flexcomp type="grid" count="500 500 500" name="f" dim="3" mass="1"/>' + BODY),
}


# the others hang until they are stopped, as the grid does, which `make test` tries
QUICK = ("heights", "a grid")


@pytest.mark.parametrize(
    "case", [case if case in QUICK else pytest.param(case, marks=pytest.mark.full) for case in TRIED]
)
def test_models_that_would_fill_the_memory(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What hangs or asks for too much does so in a process of its own."""
    monkeypatch.setattr(mujoco_trial, "SECONDS_MAX", 3.0)
    path = model(tmp_path, TRIED[case])
    with pytest.raises(SourceError) as refused:
        open_source(f"mujoco:{path}", None)
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)


def test_a_model_that_is_refused_is_refused_with_the_same_words(tmp_path: Path) -> None:
    path = model(tmp_path, mjcf("<geom size='.1'/>"))
    with pytest.raises(SourceError) as refused:
        open_source(f"mujoco:{path}", None)
    assert str(refused.value) == f"{path}: the model has no joint that moves"


@pytest.mark.parametrize(
    "text",
    [
        mjcf(tail='<keyframe><key time="1e300" qpos="0"/><key qpos="1"/></keyframe>'),
        mjcf(tail='<keyframe><key qpos="nan"/></keyframe>'),
        mjcf('<body><joint/><geom size=".1"/><body pos="1 0 0"><joint/><geom size=".1"/></body></body>'),
        mjcf(BODY.replace('mass="1"', 'mass="1e308"')),
        mjcf(tail='<actuator><position joint="j" kp="1e308" gear="1e-320"/></actuator>'),
    ],
)
def test_models_that_are_strange_move_on(text: str, tmp_path: Path) -> None:
    source = open_source(f"mujoco:{model(tmp_path, text)}", None)
    stop = threading.Event()
    samples: list[Sample] = []

    def deliver(sample: Sample) -> None:
        samples.append(sample)
        if len(samples) == 5:
            stop.set()

    source.run(deliver, stop)
    times = [sample.t_s for sample in samples]
    assert times == sorted(set(times))
    assert 0 < times[-1] < 1
