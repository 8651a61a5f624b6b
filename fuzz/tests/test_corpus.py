"""Every case in the corpus once more, what once failed among them: read, or refused in one line."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from fuzz.campaign import load
from fuzz.child import patience
from fuzz.corpus import CORPUS, cases, read_case
from fuzz.target import Target, judge

FILES = sorted(file for folder in CORPUS.iterdir() for file in cases(folder.name))


@pytest.fixture(scope="module")
def targets() -> Mapping[str, Sequence[Target]]:
    """By the folder of their cases."""
    found = defaultdict(list)
    for target in load():
        found[target.folder].append(target)
    return found


@pytest.mark.parametrize("file", FILES, ids=[f"{file.parent.name}/{file.name}" for file in FILES])
def test_case(file: Path, targets: Mapping[str, Sequence[Target]]) -> None:
    for target in targets[file.parent.name]:
        with patience():
            found = judge(target, read_case(file))
        assert found is None, f"{target.name}: {found.what}\n{found.detail}"


def test_every_target_has_cases(targets: Mapping[str, Sequence[Target]]) -> None:
    assert targets.keys() == {file.parent.name for file in FILES}


def test_the_corpus_stays_small() -> None:
    assert sum(file.stat().st_size for file in FILES) < 1_000_000


def test_a_case_may_be_written_as_hexadecimal_digits(tmp_path: Path) -> None:
    file = tmp_path / "case.hex"
    file.write_text('# a text, then three bytes\n|{"é": 1}\n00 ff # the end\n7f\n')
    assert read_case(file) == '{"é": 1}\n'.encode() + b"\0\xff\x7f"
