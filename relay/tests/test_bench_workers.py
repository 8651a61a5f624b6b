"""What the bench of workers writes into docs/reference/benchmarks.md."""

from __future__ import annotations

from relay.benches.lane.page import PAGE, fill
from relay.benches.workers import make_block


def test_the_page_has_a_place_for_what_was_measured() -> None:
    runs = [
        {"round": number, "workers": size, "cpu_us": 7.0 + size + used, "load_average": load}
        for number, load in ((1, 2.0), (2, 9.0))
        for size in (1, 2)
        for used in (-0.5, 0.0, 0.5)
    ]
    report = {
        "asked": {"workers": 2, "hz": 30.0, "bound": 50.0, "share": 0.25},
        "machine": {"day": "1 May 2030", "cores": 2, "cpu": "X"},
        "found": [{"1": 1000, "2": 1900}, {"1": 1000, "2": 1700}],
        "ratios": [1.9, 1.7],
        "runs": runs,
    }
    block = make_block(report)
    assert "| 1 | 1,000 | 1,900 | 1.90 | 8.0 | 9.0 | 2 to 2 |" in block
    assert "| 2 | 1,000 | 1,700 | 1.70 | 8.0 | 9.0 | 9 to 9 |" in block
    assert "within 50 ms, 0.25 of a core for each worker. Rounds: 2; median ratio: 1.80. 1 May 2030" in block
    assert block in fill(PAGE.read_text(), {"workers": block})
