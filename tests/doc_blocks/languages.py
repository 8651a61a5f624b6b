"""What is wrong with a block that is not a command, as the language itself says."""

from __future__ import annotations

import ast
import json
import re
import tomllib
from collections.abc import Callable
from configparser import ConfigParser
from configparser import Error as IniError
from html.parser import HTMLParser
from textwrap import dedent

import yaml

from tests.doc_blocks.block import Block
from tests.doc_blocks.programs import CHECKS

LEFT_OUT = re.compile(r",\s*…")  # further members, which the page does not show
VOID = ("br", "img", "input", "link", "meta", "source")


class Tags(HTMLParser):
    """Which elements are open. ValueError for an end without a beginning."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        """It ends later, unless it has no end."""
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """It ends what began last."""
        if self.open[-1:] != [tag]:
            raise ValueError(f"</{tag}> ends {self.open[-1:] or 'nothing'}")
        self.open.pop()


def parse_json(text: str) -> None:
    """One document or several. ValueError."""
    rest = LEFT_OUT.sub("", text).strip()
    while rest:
        _, end = json.JSONDecoder().raw_decode(rest)
        rest = rest[end:].lstrip()


def parse_html(text: str) -> None:
    """ValueError."""
    tags = Tags()
    tags.feed(text)
    if tags.open:
        raise ValueError(f"<{tags.open[-1]}> has no end")


def parse_ini(text: str) -> None:
    """A unit of systemd, or variables as its EnvironmentFile has them. ValueError."""
    has_sections = text.startswith("[")
    parser = ConfigParser(strict=False, interpolation=None, delimiters=("=",))
    try:
        parser.read_string(text if has_sections else f"[variables]\n{text}")
    except IniError as e:
        raise ValueError(str(e)) from e


def parse_python(text: str) -> None:
    """A program, or some lines of one. SyntaxError."""
    lines = dedent(text)
    ast.parse(f"{lines}    pass\n" if lines.rstrip().endswith(":") else lines)


def parse_text(text: str) -> None:
    """ValueError for a line that a reader would copy into a shell."""
    for line in text.splitlines():
        if line.strip().split(" ")[0] in CHECKS:
            raise ValueError(f"a command in a block of text: {line}")


def parse_yaml(text: str) -> None:
    """ValueError."""
    try:
        yaml.safe_load(text)
    except yaml.YAMLError as e:
        raise ValueError(str(e)) from e


def parse_toml(text: str) -> None:
    """ValueError."""
    tomllib.loads(text)


PARSERS: dict[str, Callable[[str], None]] = {
    "html": parse_html,
    "ini": parse_ini,
    "json": parse_json,
    "python": parse_python,
    "text": parse_text,
    "toml": parse_toml,
    "yaml": parse_yaml,
}


def find_language_fault(block: Block) -> str | None:
    """What the block's language says is wrong with it, or None."""
    try:
        if block.language in PARSERS:
            PARSERS[block.language](block.text)
    except (SyntaxError, ValueError) as e:
        return str(e)
    return None
