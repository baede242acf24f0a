"""The dead-man of a page, worked out by hand: which commands drive, and when it is lost."""

import pytest

from diffbotctl.web.deadman import BeatNumbers, DriveResult, EndedPresses, PageDeadman, PageLoss

DRIVES, ENDED, LATE = DriveResult.DRIVES, DriveResult.ENDED, DriveResult.LATE


@pytest.fixture
def sent():
    return []


@pytest.fixture
def deadman(sent):
    return PageDeadman(
        EndedPresses(), lambda method, **fields: sent.append((method, fields)), lambda cause: None
    )


def methods(sent):
    return [method for method, _ in sent]


def test_commands_drive_until_the_release(deadman, sent):
    assert deadman.drive(10.00, 1, 9.98, 0.1, 0.2) == DRIVES
    assert deadman.drive(10.05, 1, 10.03, 0.1, 0.0) == DRIVES
    deadman.release(1)
    assert deadman.drive(10.06, 1, 10.05, 0.1, 0.0) == ENDED  # sent before, and overtaken
    deadman.beat(11.0)
    assert sent[0] == ("drive", {"linear": 0.1, "angular": 0.2})
    assert methods(sent) == ["drive", "drive", "release"]


@pytest.mark.parametrize(
    "age, drives",
    [(0.0, True), (0.05, True), (0.299, True), (0.301, False), (5.0, False), (None, False)],
)
def test_a_command_with_an_old_number_does_not_drive(deadman, sent, age, drives):
    now = 10.0
    result = deadman.drive(now, 1, None if age is None else now - age, 0.1, 0.0)
    assert result == (DRIVES if drives else LATE)
    assert methods(sent) == ["drive"] * drives


# arrival of the last command, age of its number: when it is lost
SILENCES = [(10.0, 0.00, 10.25), (10.0, 0.10, 10.25), (10.0, 0.20, 10.20), (10.0, 0.29, 10.11)]


@pytest.mark.parametrize("arrival, age, lost", SILENCES)
def test_silence_ends_it_within_half_a_second_of_the_finger(deadman, sent, arrival, age, lost):
    deadman.drive(arrival, 1, arrival - age, 0.1, 0.0)
    deadman.beat(lost - 0.005)
    assert deadman.is_driving
    deadman.beat(lost + 0.005)
    assert sent[-1] == ("operator_lost", {"reason": PageLoss.SILENT})


def test_after_a_loss_the_finger_is_lifted_first(deadman, sent):
    deadman.drive(10.0, 1, 10.0, 0.1, 0.0)
    deadman.beat(10.3)
    for step in range(20):  # the tab thaws, the finger is still down: its numbers are new
        now = 11.0 + 0.05 * step
        assert deadman.drive(now, 1, now, 0.1, 0.0) == ENDED
    assert methods(sent) == ["drive", "operator_lost"]
    assert deadman.drive(12.0, 2, 12.0, 0.1, 0.0) == DRIVES


def test_what_piled_up_in_a_gap_does_not_drive(deadman, sent):
    deadman.drive(10.0, 1, 10.0, 0.1, 0.0)
    deadman.beat(10.3)
    assert deadman.drive(11.0, 1, 10.0, 0.1, 0.0) == ENDED
    assert deadman.drive(11.0, 2, 10.0, 0.1, 0.0) == LATE  # the finger was lifted, and put down
    assert methods(sent) == ["drive", "operator_lost"]
    assert deadman.drive(11.05, 2, 11.04, 0.1, 0.0) == DRIVES


def test_a_late_command_while_it_drives_is_a_loss(deadman, sent):
    deadman.drive(10.0, 1, 10.0, 0.1, 0.0)
    assert deadman.drive(10.2, 1, 9.8, 0.1, 0.0) == LATE
    assert sent[-1] == ("operator_lost", {"reason": PageLoss.LATE})
    assert deadman.drive(10.25, 1, 10.24, 0.1, 0.0) == ENDED


def test_a_finger_that_stays_down_while_the_page_connects_again_drives_no_more(sent):
    ended = EndedPresses()

    def connection():
        return PageDeadman(ended, lambda method, **_: sent.append(method), lambda cause: None)

    first = connection()
    first.drive(10.0, 7, 10.0, 0.1, 0.0)
    first.lose(PageLoss.CLOSED)
    second = connection()
    assert second.drive(10.1, 7, 10.1, 0.1, 0.0) == ENDED
    assert second.drive(10.5, 8, 10.5, 0.1, 0.0) == DRIVES


def test_a_late_release_of_an_earlier_press_does_not_end_the_present_one(deadman):
    deadman.drive(10.0, 1, 10.0, 0.1, 0.0)
    deadman.drive(10.1, 2, 10.1, 0.1, 0.0)
    deadman.release(1)
    assert deadman.is_driving


def test_a_refusal_of_the_engine_ends_the_press(deadman):
    deadman.drive(10.0, 1, 10.0, 0.1, 0.0)
    deadman.on_refusal()
    assert not deadman.is_driving
    assert deadman.drive(10.05, 1, 10.05, 0.1, 0.0) == ENDED


def test_a_page_that_does_not_drive_is_not_lost(deadman, sent):
    for cause in PageLoss:
        deadman.lose(cause)
    assert sent == []


def test_numbers_are_known_for_two_seconds():
    numbers = BeatNumbers()
    for step in range(1, 101):
        assert numbers.next(step * 0.05) == step
    assert numbers.sent_at(100) == pytest.approx(5.0)
    assert numbers.sent_at(61) == pytest.approx(3.05)
    assert numbers.sent_at(60) is numbers.sent_at(101) is numbers.sent_at(0) is None
