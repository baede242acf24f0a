"""The host side of our protocol: states of the link, with hand-written frames of a board."""

import pytest

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode, pack
from diffbotctl.links.diffbot_host import DiffbotHost
from diffbotctl.links.diffbot_states import LINK_STATES, TRANSITIONS, HostState
from diffbotctl.messages import Wheels
from diffbotctl.time import MILLISECOND
from tests.support.board_bench import BOOK


def hello(settings, version=frames.VERSION, boot=1):
    more = (frames.RECEIVE_MOST, len(pack(BOOK.frame())), 0)
    return encode(frames.HelloFrame(boot, version, 0, 1, 0, 1, 1, 1, 1, settings, *more))


PERIOD = 25 * MILLISECOND


def state(sequence, mode=frames.ModeCode.STOPPED, command=0, board=None, level=0, duty=0):
    """State frame of a board at `board` ns, by default one period a number."""
    time = (sequence * PERIOD if board is None else board) // frames.TICK_NANOSECONDS % 65536
    return encode(
        frames.StateFrame(
            1, sequence, 0, level, mode, 0, time, 0, 0, 4095, command, duty, 65535, 65535
        )
    )


def links(output):
    return [message.state for port, message in output if port == "link"]


@pytest.fixture
def host():
    host = DiffbotHost(BOOK)
    host.opened(0)
    return host


@pytest.fixture
def up(host):
    host.receive(MILLISECOND, hello(BOOK.mark()))
    assert host.state is HostState.UP
    return host


def test_every_state_has_transitions_and_a_link_state():
    assert set(TRANSITIONS) == set(LINK_STATES) == set(HostState)
    targets = {target for events in TRANSITIONS.values() for target in events.values()}
    assert targets == set(HostState), "each state can be reached"


def test_a_board_with_the_settings_is_up_and_gets_a_stop_first(host):
    output = host.receive(MILLISECOND, hello(BOOK.mark()))
    assert links(output) == ["up"]
    (frame,) = FrameDecoder().feed(host.send(MILLISECOND))
    assert isinstance(frame, frames.StopFrame)


def test_a_board_with_other_settings_is_sent_ours(host):
    assert links(host.receive(MILLISECOND, hello(123))) == ["negotiating"]
    assert host.state is HostState.SETTLING
    (frame,) = FrameDecoder().feed(host.send(MILLISECOND))
    assert frame == BOOK.frame()
    answer = encode(frames.AnswerFrame(frames.RefusalCode.NONE, 0, BOOK.mark()))
    assert links(host.receive(2 * MILLISECOND, answer)) == ["up"]


@pytest.mark.parametrize(
    ("version", "fix"),
    [(frames.VERSION - 1, "`diffbotctl flash firmware`"), (frames.VERSION + 1, "newer diffbotctl")],
)
def test_a_board_of_another_version_is_refused_and_nothing_moves(host, version, fix):
    host.receive(MILLISECOND, hello(BOOK.mark(), version=version))
    assert host.state is HostState.SEARCHING
    assert host.refusal.code == "E-BOARD-VERSION"
    assert fix in host.refusal.fix and "\n" not in host.refusal.fix
    host.command(MILLISECOND, Wheels(MILLISECOND, 5.0, 5.0))
    sent = b"".join(host.send(now * MILLISECOND) for now in range(2, 500))
    assert {type(frame) for frame in FrameDecoder().feed(sent)} <= {frames.AskFrame}


def test_a_frame_shows_duty_and_level_of_one_wheel(up):
    shown = []
    for sequence, level, duty in ((1, 1, -127), (2, 0, 0), (3, 0, 127), (4, 1, -1)):
        output = up.receive(sequence * PERIOD, state(sequence, level=level, duty=duty))
        (encoders,) = (message for port, message in output if port == "encoders")
        shown.append((encoders.left_level, encoders.right_level))
        shown.append((encoders.left_duty, encoders.right_duty))
    levels, duties = shown[::2], shown[1::2]
    assert levels == [(None, 1), (0, None), (None, 0), (1, None)]
    assert duties == [(None, -1.0), (0.0, None), (None, 1.0), (-1.0 / 127.0, None)]


def test_silence_is_stale_then_lost(up):
    start = MILLISECOND
    assert links(up.on_time(start + 249 * MILLISECOND)) == []
    assert links(up.on_time(start + 250 * MILLISECOND)) == ["stale"]
    assert links(up.receive(start + 260 * MILLISECOND, state(1))) == ["up"]
    assert links(up.on_time(start + 510 * MILLISECOND)) == ["stale"]
    assert links(up.on_time(start + 1260 * MILLISECOND)) == ["lost"]
    assert up.state is HostState.SEARCHING


def test_states_with_an_unknown_mode_are_a_problem_of_the_link(up):
    for number in range(12):
        output = up.receive((2 + 25 * number) * MILLISECOND, state(number, mode=9))
        assert output == [], "nothing in the frame can be trusted"
        output += up.on_time((3 + 25 * number) * MILLISECOND)
        if output:
            break
    ((port, link),) = output
    assert (port, link.state) == ("link", "stale") and "unknown mode, 9" in link.cause
    assert links(up.receive(400 * MILLISECOND, state(12))) == ["up"]


def test_a_frame_that_is_repeated_is_no_sign_of_life(up):
    assert up.receive(2 * MILLISECOND, state(1)) != []
    for number in range(9):
        output = up.receive((27 + 25 * number) * MILLISECOND, state(1))
        assert output + up.on_time((28 + 25 * number) * MILLISECOND) == []
    ((port, link),) = up.on_time(253 * MILLISECOND)
    assert (port, link.state) == ("link", "stale") and "repeats the same frame" in link.cause
    assert links(up.receive(300 * MILLISECOND, state(2))) == ["up"]


def test_frames_whose_time_stands_still_are_no_sign_of_life(up):
    assert up.receive(2 * MILLISECOND, state(1, board=0)) != []
    for number in range(9):
        now = (27 + 25 * number) * MILLISECOND
        assert up.receive(now, state(2 + number, board=0)) == []
    ((port, link),) = up.on_time(253 * MILLISECOND)
    assert (port, link.state) == ("link", "stale") and "time in the board's" in link.cause


def test_a_frame_that_is_older_than_the_last_one_is_no_measurement(up):
    assert up.receive(2 * MILLISECOND, state(1)) != []
    assert up.receive(27 * MILLISECOND, state(2)) != []
    assert up.receive(30 * MILLISECOND, state(1)) == []
    assert up.receive(52 * MILLISECOND, state(3)) != []


def test_a_board_that_answers_but_sends_no_state_is_lost(up):
    """Its hello and status frames tell nothing of the wheels."""
    status = encode(frames.StatusFrame(0, 0))
    up.receive(2 * MILLISECOND, state(1))
    seen = []
    for step in range(60):
        now = (27 + 25 * step) * MILLISECOND
        output = up.receive(now, status)
        output += up.receive(now, hello(BOOK.mark())) if step % 10 == 0 else []
        seen += links(output + up.on_time(now))
    assert seen[:2] == ["stale", "lost"]


def test_a_stop_is_confirmed_by_its_number(up):
    (stop,) = FrameDecoder().feed(up.send(MILLISECOND))
    up.receive(30 * MILLISECOND, state(1, command=(stop.sequence + 1) % 16))
    assert not up.stopped
    up.receive(60 * MILLISECOND, state(2, command=stop.sequence))
    assert up.stopped


def test_a_closed_port_is_lost_and_has_nothing_due(up):
    assert links(up.closed(MILLISECOND, "unplugged")) == ["lost"]
    assert up.send(10**12) == b"" and up.due() > 10**15


def unheard(host, first, seconds, left=2.0, gap=None):
    """Stops of the host while a robot is commanded and the board shows none of its commands."""
    stops = []
    for step in range(round(seconds * 40)):
        now = first + step * 25 * MILLISECOND
        host.command(now, Wheels(now, left, left))
        host.send(now)
        if gap is not None and gap[0] <= step / 40 < gap[1]:
            continue
        mode = frames.ModeCode.EXPIRED
        output = host.receive(now, state((step + 1) % 64, mode, command=9, board=now))
        stops += [message for port, message in output if port == "stop" and message.code]
    return stops


def test_a_motion_that_the_board_never_shows_stops_the_robot_and_names_the_wire(up):
    stops = unheard(up, 2 * MILLISECOND, 1.2)
    assert [stop.code for stop in stops] == ["commands_lost"]
    assert stops[0].latched and "RX" in stops[0].cause


def test_after_resume_the_same_is_reported_again(up):
    assert len(unheard(up, 2 * MILLISECOND, 2.3)) == 2


def test_a_robot_that_stands_is_not_stopped_for_commands_that_do_not_arrive(up):
    assert unheard(up, 2 * MILLISECOND, 3, left=0.0) == []


def test_frames_that_were_held_back_are_not_evidence_that_commands_are_lost(up):
    assert unheard(up, 2 * MILLISECOND, 1.4, gap=(0.1, 0.8)) == []
