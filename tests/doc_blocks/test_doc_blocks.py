"""Every fenced block of every page is run by a test, is read here as data, or is on a short list with a
reason. The commands of all of them are checked by the programs' own parsers.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.doc_blocks.block import ROOT, Block, list_blocks, read_pages
from tests.doc_blocks.inventory import DATA, NOT_RUN, RUN, TEXT
from tests.doc_blocks.languages import find_language_fault
from tests.doc_blocks.programs import find_fault
from tests.doc_blocks.shell import ShellError, list_calls

pytestmark = pytest.mark.docs

PAGES = read_pages()
SHELL = "sh"
NOT_RUN_MAX = 40  # lines: whoever adds one reads this, and thinks of a way to run the block instead
Line = tuple[str, str, str]


def list_run_lines() -> Iterator[Line]:
    """(page, words, test)."""
    for page, blocks in RUN.items():
        for words, test in blocks.items():
            yield page, words, test


def list_lines() -> Iterator[Line]:
    """(page, words, test or reason) of both tables."""
    yield from list_run_lines()
    for reason, pages in NOT_RUN.items():
        for page, listed in pages.items():
            for words in listed:
                yield page, words, reason


LINES = list(list_lines())


def find_lines(block: Block) -> list[Line]:
    return [line for line in LINES if line[0] == block.page and line[1] in block.source]


def read_docstring(node: ast.AST) -> str:
    """The text that alone makes up a statement."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return str(node.value.value)
    return ""


def find_command_faults(blocks: list[Block], folder: Path) -> list[str]:
    """What is wrong with the commands of one page."""
    try:
        calls = list_calls([block for block in blocks if block.language == SHELL], folder)
    except ShellError as e:
        return [str(e)]
    for name in {word for call in calls for word in call.words if word.endswith(".credential")}:
        credential = folder / Path(name).name
        credential.write_text(f"posecast1:{credential.stem}:{'s' * 43}\n", encoding="ascii")
        credential.chmod(0o600)
    return [f"{call.block}: {fault}" for call in calls if (fault := find_fault(call.words))]


@pytest.mark.parametrize("page", PAGES)
def test_each_block_is_run_or_read_or_excluded(page: str) -> None:
    for block in PAGES[page]:
        found = find_lines(block)
        assert len(found) <= 1, f"{block} is in several lines of the inventory: {found}"
        if not found:
            assert block.language in (*DATA, *TEXT), f"{block} is in no line of the inventory"


def test_each_line_of_the_inventory_stands_for_a_block() -> None:
    used = {line for blocks in PAGES.values() for block in blocks for line in find_lines(block)}
    assert [line for line in LINES if line not in used] == []


def test_few_blocks_are_not_run() -> None:
    left = [
        block
        for blocks in PAGES.values()
        for block in blocks
        for line in find_lines(block)
        if line[2] in NOT_RUN
    ]
    commands = [block for blocks in PAGES.values() for block in blocks if block.language == SHELL]
    print(f"{len(left)} of {len(commands)} blocks of commands are not run")
    assert sum(len(listed) for pages in NOT_RUN.values() for listed in pages.values()) <= NOT_RUN_MAX


@pytest.mark.parametrize(("page", "test"), sorted({(page, test) for page, _, test in list_run_lines()}))
def test_the_named_test_reads_the_page(page: str, test: str) -> None:
    nodes = list(ast.walk(ast.parse((ROOT / test).read_text(encoding="utf-8"))))
    texts = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    texts -= {value for node in nodes if (value := read_docstring(node))}
    assert Path(page).stem in {Path(text).name.removesuffix(".md") for text in texts}


@pytest.mark.parametrize("page", [page for page in PAGES if any(b.language == SHELL for b in PAGES[page])])
def test_commands_are_what_their_programs_take(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_command_faults(PAGES[page], tmp_path) == []


@pytest.mark.parametrize("page", PAGES)
def test_other_languages_can_be_parsed(page: str) -> None:
    faults = {str(block): find_language_fault(block) for block in PAGES[page]}
    assert {block: fault for block, fault in faults.items() if fault} == {}


@pytest.mark.parametrize(
    ("language", "text", "said"),
    [
        ("sh", "posecast run --sauce demo", "--sauce"),
        ("sh", "runuser -u x -- /opt/posecast/bin/posecast-relay past liszt", "liszt"),
        ("sh", "docker compose -f infra/docker-compose.yml exec -T relay posecast-relay robots ad x", "ad"),
        ("sh", "docker compose -f infra/docker-compose.yml restart grafanna", "grafanna"),
        ("sh", "make dmeo", "dmeo"),
        ("sh", "make demo PROT=1", "PROT"),
        ("sh", "npm run e2e -w spa -- no_such_test", "no_such_test"),
        ("sh", ".venv/bin/python -m tools.scaling --inn x", "--inn"),
        ("sh", ".venv/bin/python -m tools.scalling", "tools.scalling"),
        ("sh", "cp infra/systemd/posecast.service /etc", "infra/systemd/posecast.service"),
        ("sh", "(posecast relay run --dev", "syntax error"),
        ("sh", 'pip install "$(ls dist/posecast-*.whl)[exprot]"', "exprot"),
        ("sh", "pcast demo", "pcast"),
        ("sh", "word=$(posecast probe --secs 3 demo)", "--secs"),
        ("toml", "[robot\n", "Expected"),
        ("json", '{"a": 1,}', "double quotes"),
        ("yaml", "a: [1", "flow sequence"),
        ("python", "def f(:", "syntax"),
        ("html", "<p><b></p>", "</p>"),
        ("ini", "no value", "no value"),
        ("text", "posecast demo", "posecast demo"),
    ],
)
def test_what_is_broken_is_found(
    language: str, text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (block,) = list_blocks("page.md", f"```{language}\n{text}\n```\n")
    monkeypatch.chdir(tmp_path)
    faults = (
        find_command_faults([block], tmp_path) if language == SHELL else [find_language_fault(block) or ""]
    )
    assert len(faults) == 1
    assert said in faults[0]


def test_a_block_in_a_list_has_no_indent() -> None:
    (block,) = list_blocks("page.md", "1. Do:\n\n    ```sh\n    make demo\n    ```\n")
    assert (block.language, block.text, block.line) == ("sh", "make demo\n", 3)
