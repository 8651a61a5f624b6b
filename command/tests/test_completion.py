"""Shells complete what there is."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from posecast_command.completion import make_script
from posecast_command.programs import SHELLS


@pytest.mark.parametrize("shell", SHELLS)
def test_the_shell_reads_it(shell: str, tmp_path: Path) -> None:
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"no {shell} here")
    script = tmp_path / "script"
    script.write_text(make_script(shell))
    read = subprocess.run([program, "-n", str(script)], capture_output=True, text=True, check=False)
    assert (read.returncode, read.stderr) == (0, "")


@pytest.mark.parametrize(
    ("shell", "script", "answer"),
    [
        (
            "zsh",
            'autoload -U compinit; compinit -u -D; eval "$SCRIPT"; echo $_comps[posecast]',
            "_shtab_posecast",
        ),
        ("fish", "echo $SCRIPT | source; complete -C 'posecast comp' | cut -f 1", "completion"),
    ],
)
def test_the_line_of_the_docs_makes_the_shell_complete(shell: str, script: str, answer: str) -> None:
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"no {shell} here")
    no_settings = {"zsh": "-f", "fish": "--no-config"}[shell]
    told = subprocess.run(
        [program, no_settings, "-c", script],
        env={**os.environ, "SCRIPT": make_script(shell)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (told.stdout.strip(), told.stderr) == (answer, "")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("posecast de", {"demo"}),
        ("posecast relay ", {"run", "robots", "past", "convert"}),
        ("posecast convert --re", {"--replace"}),
        ("posecast convert ro", {"robot.urdf"}),
        ("posecast relay robots ad", {"add"}),
        ("posecast past exp", {"export"}),
        ("posecast model b", {"build"}),
        ("posecast demo --no", {"--no-browser"}),
        ("posecast run --up", {"--up-axis"}),
        ("posecast edge run --cred", {"--credential"}),
        ("posecast doctor --up-axis ap", {"apply"}),
        ("posecast completion z", {"zsh"}),
        ("posecast doctor --urdf ro", {"robot.urdf"}),
    ],
)
def test_bash_completes(line: str, words: set[str], tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").touch()
    typed = line.split(" ")
    words_typed = " ".join(repr(word) for word in typed)
    script = (
        f"{make_script('bash')}\nCOMP_WORDS=({words_typed}); COMP_CWORD={len(typed) - 1}\n"
        '_shtab_posecast; printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    told = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, check=True, cwd=tmp_path
    ).stdout.split()
    assert words <= set(told)
