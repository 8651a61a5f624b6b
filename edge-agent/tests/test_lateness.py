from __future__ import annotations

from posecast_edge.uplink.lateness import EchoWatch, News, RateControl
from posecast_wire.keys import Echo


def linked() -> EchoWatch:
    watch = EchoWatch(7)
    watch.record_link(True)
    return watch


def test_words() -> None:
    watch = EchoWatch(7)
    assert watch.describe_state(0.0) == "no link"
    watch.record_link(True)
    assert watch.describe_state(0.0) == "no relay"
    watch.record_answer(Echo(0, 0, 0.0), 0.0, 0.01)
    assert watch.describe_state(0.1) == "waiting"
    watch.record_frame(0, 0.2)
    assert watch.describe_state(0.3) == "waiting"
    assert watch.describe_state(2.3) == "refused"
    watch.record_answer(Echo(7, 0, 0.0), 2.4, 2.41)
    assert watch.describe_state(2.5) == "on air"
    watch.record_answer(Echo(8, 9, 0.0), 3.4, 3.41)  # another run has the robot now
    assert watch.describe_state(3.5) == "refused"
    watch.record_answer(None, 4.4, 4.41)
    assert watch.describe_state(4.5) == "no relay"
    watch.record_link(False)
    assert watch.describe_state(5.0) == "no link"


def test_a_frame_that_is_not_there_yet_is_late() -> None:
    watch = linked()
    for seq in range(60):
        watch.record_frame(seq, seq / 30)
    watch.record_answer(Echo(7, 29, 0.0), 2.0, 2.01)
    assert abs(watch.late_s - 1.0) < 1e-9  # seq 30 left at 1.0 and was asked for at 2.0
    assert watch.describe_state(2.1) == "late"
    watch.record_answer(Echo(7, 59, 0.0), 3.0, 3.01)
    assert watch.late_s == 0.0
    assert watch.describe_state(3.1) == "on air"


def test_a_slow_answer_means_a_queue() -> None:
    watch = linked()
    watch.record_frame(0, 0.0)
    watch.record_answer(Echo(7, 0, 0.0), 1.0, 1.05)  # 50 ms: the way there and back
    watch.record_frame(1, 1.5)
    watch.record_answer(Echo(7, 1, 0.0), 2.0, 2.85)
    assert abs(watch.late_s - 0.8) < 1e-9
    watch.record_answer(None, 3.0, 5.0)  # no answer in time
    assert watch.describe_state(5.0) == "late"


def test_while_an_answer_is_overdue_nothing_is_worth_sending() -> None:
    w = linked()
    w.record_frame(0, 10.0)
    w.record_question(10.0)
    assert not w.is_queue_full(19.0), "a relay that never answered may know no echo"
    w.record_answer(Echo(7, 0, 0.0), 10.0, 10.1)
    assert not w.is_queue_full(30.0), "nothing is asked"
    w.record_question(30.0)
    assert [w.is_queue_full(30.0 + s) for s in (0.0, 0.5, 0.59, 0.61, 5.0)] == [
        False,
        False,
        False,
        True,
        True,
    ]
    w.record_answer(None, 30.0, 32.0)  # given up
    assert not w.is_queue_full(33.0)
    w.record_question(33.0)
    w.record_link(False)
    assert not w.is_queue_full(40.0)


def test_old_frames_are_forgotten_with_the_link() -> None:
    watch = linked()
    watch.record_frame(0, 0.0)
    watch.record_link(False)
    watch.record_link(True)
    watch.record_frame(500, 100.0)
    watch.record_answer(Echo(7, 500, 0.0), 100.1, 100.11)
    assert watch.late_s == 0.0


def test_a_relay_that_takes_nothing_refuses_and_is_not_late() -> None:
    watch = linked()
    for seq in range(100, 160):
        watch.record_frame(seq, (seq - 100) / 30)
    watch.record_answer(Echo(7, 90, 0.0), 1.0, 1.01)  # its newest is from before the link broke
    assert watch.late_s == 0.0
    assert watch.describe_state(1.1) == "waiting"
    watch.record_answer(Echo(7, 90, 0.0), 2.5, 2.51)
    assert watch.describe_state(2.6) == "refused"
    watch.record_answer(Echo(7, 159, 0.0), 3.5, 3.51)
    assert watch.describe_state(3.6) == "on air"


def test_rate_halves_settles_and_recovers() -> None:
    rate = RateControl(30.0)
    rate.record_lateness(0.4, 0.0)
    assert rate.hz == 30.0
    rate.record_lateness(0.6, 1.0)
    assert rate.hz == 15.0
    rate.record_lateness(0.9, 2.0)
    assert rate.hz == 15.0  # half the rate has had no time to help
    rate.record_lateness(0.9, 3.0)
    assert rate.hz == 7.5
    for i in range(20):
        rate.record_lateness(5.0, 5.0 + 2 * i)
    assert rate.hz == 1.0
    hz = []
    for i in range(40):
        rate.record_lateness(0.01, 50.0 + i)
        hz.append(rate.hz)
    assert sorted(set(hz)) == [1.0, 2.0, 4.0, 8.0, 16.0, 30.0]
    assert hz.index(2.0) == 5
    assert hz[-1] == 30.0


def test_refused_and_on_air_again_are_told_once() -> None:
    news = News()
    words = ["waiting", "on air", "refused", "refused", "no link", "waiting", "refused", "late", "on air"]
    said = [news.list_changes(word, "", float(i)) for i, word in enumerate(words)]
    refused = ["the relay accepts no frames: does another agent publish this robot? Still sending"]
    assert said == [[], [], refused, [], [], [], [], ["on air again"], []]


def test_what_is_over_the_share_is_told_when_it_changes() -> None:
    news = News()
    over = "120 frames a second a view"
    told = "the relay drops some of this robot's data: more than "
    assert news.list_changes("on air", over, 0.0) == [told + over]
    assert news.list_changes("on air", over, 1.0) == []
    assert news.list_changes("on air", "", 2.0) == [], "it comes and goes at the edge of the share"
    assert news.list_changes("on air", over, 3.0) == []
    assert news.list_changes("no link", "", 20.0) == [], "nothing is known"
    assert news.list_changes("on air", "1 MB a second", 21.0) == [told + "1 MB a second"]
    assert news.list_changes("on air", "", 26.5) == ["the relay accepts all of this robot's data again"]
    assert news.list_changes("on air", "", 40.0) == []


def test_what_is_over_is_known_by_the_newest_echo() -> None:
    watch = linked()
    assert watch.over == ""
    watch.record_answer(Echo(7, 0, 0.0, "600 frames a second"), 0.0, 0.01)
    assert watch.over == "600 frames a second"
    watch.record_answer(None, 1.0, 1.01)
    assert watch.over == ""


def test_an_answer_with_a_number_that_was_never_sent_is_no_sign_of_being_on_air() -> None:
    watch = linked()
    watch.record_frame(0, 0.2)
    watch.record_answer(Echo(7, 9, 0.0), 2.4, 2.41)
    assert watch.describe_state(2.5) == "refused"
    watch.record_answer(Echo(7, 0, 0.0), 2.6, 2.61)
    assert watch.describe_state(2.7) == "on air"
