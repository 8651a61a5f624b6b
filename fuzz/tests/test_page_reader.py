from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from fuzz.page_reader import Page, bundled, xml_tree
from fuzz.target import Gone, Refused

PONG = b'{"type":"pong","t":1}'
SCHEMA = b'{"type":"schema","v":1,"robot":"a","labels":{"x":["x"]},"fields":[{"name":"x","labels":"x"}]}'


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    page = Page(bundled())
    yield page
    page.close()


def test_answers_as_the_page_reads(page: Page) -> None:
    assert page.ask("schema", SCHEMA)["robot"] == "a"
    assert page.ask("message", b'{"type":"nothing"}') is None


def test_numbers_that_json_lacks_come_too(page: Page) -> None:
    joints = b',"mapping":{"joints":{"far":{"terms":[["x",1e308],["x",1e308]]}}}}'
    schema = SCHEMA.replace(b'"name":"x"', b'"name":"pos"')[:-1] + joints
    found = page.ask("mapping", schema + b"\n" + b"\xff\xff\xff\x7f")
    assert found["pos"] == {"far": math.inf}


def test_refusals_are_told_from_faults(page: Page) -> None:
    with pytest.raises(Refused, match="not JSON"):
        page.ask("schema", b"{")


def test_the_ways_that_typescript_takes_are_counted(page: Page) -> None:
    broken, good, again = (page.ways("message", data) for data in (b"{", PONG, PONG))
    assert broken != good == again
    assert good


def test_a_node_that_is_gone_is_noticed() -> None:
    page = Page(bundled())
    page.close()
    with pytest.raises(Gone):
        page.ask("message", b"{}")


def test_xml_is_read_as_a_browser_reads_it() -> None:
    assert xml_tree(b'<a x="1"><b/></a>') == ["a", {"x": "1"}, [["b", {}, []]]]
    assert xml_tree(b"<a>\n<b></a>") == 2
    assert isinstance(xml_tree(b"<n:a/>"), int)  # its prefix is not declared
