"""The shipped image on the emulated board."""

from dataclasses import replace
from itertools import pairwise
from random import Random

import pytest

from diffbotctl.emulator.emulated_robot import motor_pins
from diffbotctl.emulator.process import LINE, Emulator
from diffbotctl.emulator.program import bootloader, build
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import FrameDecoder, encode_payload
from diffbotctl.time import MILLISECOND as MS
from tests.sampling import by_day, each_once
from tests.support.board_bench import BOOK, PICO, RADIO, UNO, USB, BoardBench, speed
from tests.support.trials import (
    board,
    board_faults,
    board_restarts,
    board_runs,
    board_settings,
    frame_damage,
    wheel_loop,
)


def mode(bench):
    """Mode of the newest state frame after 60 ms."""
    bench.wait(60)
    return frames.ModeCode(bench.state().mode).name.lower()


DAY = {
    "latency": lambda: board.latency(3, 20),
    "edges": lambda: board.edges(seconds=0.2),
    "bounce": lambda: board.bounce(3, 1),
    "settings": lambda: board_settings.refused_settings(3, 25),
    "deadman": lambda: board.deadman(3, 18),
    "damage": lambda: frame_damage.through_binary(3, 60),
    "speed loop": lambda: board_runs.agreement(3, 2),
}
NIGHT = {
    "telemetry": lambda: board.telemetry(10),
    "eeprom": lambda: board_settings.eeprom_cuts(3, 60),
    "restarts": lambda: board.restarts(3, 3),
    "encoder storms": lambda: board_faults.storms(3, 12),
    "hello after a reset": lambda: board_faults.hellos(3, 10),
    "healthy starts of the binary": lambda: wheel_loop.starts(4, 4, emulated=True),
    "stalls of the binary": lambda: wheel_loop.stalls(4, 4, emulated=True),
    "healthy starts": lambda: wheel_loop.starts(3, 30),
    "stalls": lambda: wheel_loop.stalls(3, 20),
    "restarts under a goal": lambda: board_restarts.rows(3, 3),
}


@pytest.mark.parametrize("name", by_day(len(DAY), DAY | NIGHT))
def test_figures(name):
    for row in (DAY | NIGHT)[name]():
        assert row.met, row


def test_nothing_moves_before_settings():
    with BoardBench() as bench:
        bench.wait(30)
        assert bench.ask().settings == 0
        bench.claim()
        bench.send(RADIO, speed(1, 5, 5), frames.DutyFrame(2, 30000, 30000))
        assert mode(bench) == "unset"
        assert bench.changes == []


def test_settings_survive_a_reset():
    with BoardBench() as bench:
        bench.ready()
        bench.wait(400)
        bench.emulator.reset(LINE)
        bench.wait(30)
        hello = bench.ask()
        assert hello.settings == BOOK.mark()
        assert hello.reset == frames.ResetCode.LINE


@each_once(settings=(BOOK, UNO), run_ms=(40, 210, 275))
def test_telemetry_has_no_gap_after_a_reset(settings, run_ms):
    """The clock's timer starts anew, whatever its state is when the bootloader ends.

    With an old overflow flag the time jumps back in the middle of the timer's first round, and
    telemetry pauses for 250 ms.
    """
    pins, board = motor_pins(settings), settings.board
    with BoardBench(settings=settings) as bench:
        bench.emulator.close()
        bench.emulator = Emulator(pins, board=board, boot=bootloader(board))
        bench.wait(1500)  # the bootloader waits for a new program
        bench.ready()
        bench.wait(run_ms)
        bench.emulator.reset(LINE)
        bench.received.clear()
        for number in range(50):  # telemetry starts with the first frame after the bootloader
            bench.send(RADIO, frames.StopFrame(number))
            bench.wait(40)
        times = [each.time for each in bench.received if isinstance(each.frame, frames.StateFrame)]
        assert len(times) > 20
        assert max(later - earlier for earlier, later in pairwise(times)) < 60 * MS


def test_settings_are_refused_in_motion():
    with BoardBench() as bench:
        bench.ready()
        bench.turn(2)
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(30)
        bench.send(RADIO, replace(BOOK, glitch=5 * MS).frame())
        for number in range(4):
            bench.send(RADIO, speed(number, 5, 5))
            bench.wait(60)
        answer = next(
            h.frame for h in reversed(bench.received) if isinstance(h.frame, frames.AnswerFrame)
        )
        assert answer.refusal == frames.RefusalCode.MOVING
        assert answer.settings == BOOK.mark()


def test_duty_of_a_command_is_the_feed_forward():
    with BoardBench() as bench:
        bench.ready()
        bench.turn(1)
        bench.send(RADIO, speed(1, 5.0, -2.5))
        bench.wait(12)  # the frame takes 10.4 ms, and the loop has run once at most
        # 0.10 + 0.086 x 5 = 0.530 and 0.10 + 0.086 x 2.5 = 0.315; a PWM step is 0.004
        assert bench.duty == pytest.approx([0.530, -0.315], abs=0.004)


@pytest.mark.parametrize(("brake", "expected"), [(False, 0.0), (True, 1.0)])
def test_coast_or_brake_at_standstill(brake, expected):
    with BoardBench(settings=replace(BOOK, brake=brake)) as bench:
        bench.ready()
        bench.turn(1)
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(20)
        bench.send(RADIO, frames.StopFrame(2))
        bench.wait(20)
        assert bench.duty == [0.0, 0.0]
        assert [change.shorted for change in bench.changes[-2:]] == [expected] * 2


def test_raw_duty():
    with BoardBench() as bench:
        bench.ready()
        bench.turn(1)
        bench.send(RADIO, frames.DutyFrame(1, 16384, -frames.DUTY_ONE))
        assert mode(bench) == "duty"
        assert bench.duty == pytest.approx([0.5, -1.0], abs=0.004)
        bench.wait(300)
        assert bench.duty == [0.0, 0.0]


def test_a_driven_wheel_without_edges_is_a_fault():
    """No edge for 0.95 s at 5 rad/s; then a clear and a stop are needed."""
    with BoardBench() as bench:
        bench.ready()
        for number in range(20):
            bench.send(RADIO, speed(number, 5, 0))
            bench.wait(50)
        assert mode(bench) == "fault"
        assert bench.duty == [0.0, 0.0]
        status = [h.frame for h in bench.wait(1100) if isinstance(h.frame, frames.StatusFrame)]
        flags = [each.value for each in status if each.item == frames.ItemCode.FLAGS]
        assert flags[-1] >> 6 == 0b01  # the left wheel
        bench.claim()
        assert mode(bench) == "fault"
        bench.send(RADIO, frames.ActionFrame(1, 0))
        bench.claim()
        assert mode(bench) == "stopped"


@pytest.mark.parametrize("owner", [RADIO, USB])
def test_any_link_may_stop_and_the_owner_must_stop_before_it_drives_again(owner):
    with BoardBench() as bench:
        bench.ready(owner)
        bench.turn(3)
        bench.send(owner, speed(1, 5, 5))
        bench.wait(20)
        bench.send(1 - owner, frames.AskFrame(frames.VERSION), frames.StopFrame(9))
        bench.wait(20)
        assert bench.duty == [0.0, 0.0]
        for number in range(3):
            bench.send(owner, speed(number, 5, 5))
            bench.wait(50)
        assert bench.duty == [0.0, 0.0]
        assert mode(bench) == "overruled"
        bench.claim(owner)
        bench.send(owner, speed(4, 5, 5))
        bench.wait(20)
        assert min(bench.duty) > 0.5


@pytest.mark.parametrize("other", [replace(BOOK, glitch=MS), replace(BOOK, brake=True)])
def test_new_settings_do_not_let_an_overruled_link_drive_again(other):
    with BoardBench() as bench:
        bench.ready(RADIO)
        bench.turn(3)
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(20)
        bench.send(USB, frames.StopFrame(9))
        bench.wait(20)
        bench.pins.clear()  # the wheels stand
        for number in range(12):
            bench.send(RADIO, speed(number, 5, 5))  # still the owner
            bench.wait(50)
        assert mode(bench) == "overruled"
        assert bench.configure(other).refusal == frames.RefusalCode.NONE
        bench.send(RADIO, speed(4, 5, 5))
        bench.wait(30)
        assert bench.duty == [0.0, 0.0], "the stop of the other link was forgotten"
        bench.claim(RADIO)
        bench.send(RADIO, speed(5, 5, 5))
        bench.wait(30)
        assert min(bench.duty) > 0.5


def test_the_stop_button():
    with BoardBench(settings=replace(BOOK, button=30)) as bench:
        bench.pins.append(bench.pins[0]._replace(pin=30, level=1))
        bench.ready()
        bench.turn(2)
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(20)
        assert min(bench.duty) > 0.5
        bench.pins.append(bench.pins[0]._replace(time=bench.now + MS, pin=30, level=0))
        bench.wait(6)
        assert bench.duty == [0.0, 0.0]
        bench.claim()
        assert mode(bench) == "button"
        bench.pins.append(bench.pins[0]._replace(time=bench.now + MS, pin=30, level=1))
        bench.wait(20)
        assert mode(bench) == "button"
        bench.claim()
        assert mode(bench) == "stopped"


@pytest.mark.parametrize("limit", [100, 300, 500])
def test_the_deadman_time_is_a_setting(limit):
    with BoardBench(settings=replace(BOOK, deadman=limit * MS)) as bench:
        bench.ready()
        bench.turn(2)
        start = bench.now + 10_400_000
        bench.changes.clear()
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(600)
        end = bench.changes[-1].time
        assert bench.duty == [0.0, 0.0]
        assert limit * MS <= end - start <= (limit + 20) * MS
        assert mode(bench) == "expired"


def test_range_is_the_mean_of_the_readings():
    with BoardBench() as bench:
        bench.ready()
        for millivolts in (0, 1000, 2500, 4990):
            bench.run(bench.now + 120 * MS, {0: millivolts})
            # simavr scales by 1023 and truncates: at most one reading low, four here
            assert bench.state().range == pytest.approx(millivolts / 5000 * 4092, abs=4.1)


def test_counts_frames_at_48_hz():
    with BoardBench(settings=replace(BOOK, edge_times=False, telemetry=48)) as bench:
        bench.ready()
        bench.turn(5)
        arrived = [h for _ in range(40) for h in bench.wait(50)]
        counts = [h.frame for h in arrived if isinstance(h.frame, frames.CountsFrame)]
        assert len(counts) >= 95
        steps = {(b.sequence - a.sequence) % 64 for a, b in pairwise(counts)}
        assert steps == {1}


@pytest.mark.parametrize("edge_times", [True, False])
def test_frames_tell_the_levels_of_the_pins_in_turn(edge_times):
    """The left pin in frames of even sequence, the right one in the others."""
    with BoardBench(settings=replace(BOOK, edge_times=edge_times)) as bench:
        bench.ready()
        for left, right in ((1, 0), (1, 1), (0, 1), (0, 0)):
            at = bench.now + MS
            bench.pins += [board.PinTransition(at, 2, left), board.PinTransition(at, 3, right)]
            bench.wait(60)  # frames from before are on the line for 40 ms at most
            arrived = [h.frame for _ in range(4) for h in bench.wait(50)]
            reported = [f for f in arrived if isinstance(f, frames.StateFrame | frames.CountsFrame)]
            assert len(reported) > 4
            assert all(f.level == (right if f.sequence % 2 else left) for f in reported)


@each_once(settings=(BOOK, UNO, PICO), edge_times=(True, False))
def test_frames_have_the_duties_in_turn(settings, edge_times):
    """The left motor's in frames of even sequence, the right one's in the others."""
    one, least = frames.DUTY_ONE, 0.5 / 127 + 0.5 / 255  # rounding of the frame and of the pulses
    commands = [
        *(
            frames.DutyFrame(0, left, right)
            for left, right in ((one, -one), (-one // 3, one // 99))
        ),
        speed(0, 4.0, -7.0),
        frames.StopFrame(0),
    ]
    with BoardBench(settings=replace(settings, edge_times=edge_times, telemetry=38)) as bench:
        bench.ready()
        for number, command in enumerate(commands):
            bench.send(RADIO, command._replace(sequence=number))
            bench.turn(0.2)
            bench.wait(70)
            duty = tuple(bench.duty)
            arrived = [h.frame for h in bench.wait(100)]
            reported = [f for f in arrived if isinstance(f, frames.StateFrame | frames.CountsFrame)]
            assert {f.command for f in reported} == {number}
            assert {f.sequence % 2 for f in reported} == {0, 1}
            for frame in reported:
                shown = frame.duty / frames.REPORTED_DUTY_ONE
                assert abs(shown) <= 1.0
                assert shown == pytest.approx(duty[frame.sequence % 2], abs=least)
            bench.send(RADIO, frames.StopFrame(number))
            bench.wait(30)


def test_capture_has_every_edge():
    with BoardBench() as bench:
        bench.ready()
        bench.send(RADIO, frames.ActionFrame(2, 1))
        bench.wait(50)
        bench.turn(2, rate=20)
        arrived = [h.frame for _ in range(45) for h in bench.wait(50)]
        captured = [frame for frame in arrived if isinstance(frame, frames.CaptureFrame)]
        assert not any(frame.lost for frame in captured)
        edges = [edge for frame in captured for edge in frame.edges[: frame.used]]
        # 2 wheels, 40 slots, 2 edges
        assert len(edges) == 160
        assert [edge >> 15 for edge in edges].count(1) == 80
        assert [edge >> 14 & 1 for edge in edges].count(1) == 80
        # Board times of the edges, from the frame's time and their low bits: 25 ms apart.
        times = sorted(
            frame.time - (frame.time - edge & frames.CAPTURE_TIME)
            for frame in captured
            for edge in frame.edges[: frame.used]
        )
        flank = 25 * MS / frames.TICK_NANOSECONDS
        steps = [round((time - times[0]) / flank) for time in times]
        assert steps == [step for step in range(80) for _ in range(2)]
        assert all(abs(t - times[0] - n * flank) <= 3 for t, n in zip(times, steps, strict=True))


def test_a_quadrature_encoder_counts_with_its_direction():
    """Channel B 90 degrees behind A: forward; ahead of it: backward."""
    settings = replace(BOOK, left=replace(BOOK.left, encoder_b=22))
    with BoardBench(settings=settings) as bench:
        bench.pins.append(board.PinTransition(0, 22, 0))
        bench.ready()
        for lag, expected in ((5 * MS, 10), (-5 * MS, -10)):
            before = bench.state().left
            start = bench.now + 20 * MS
            for index in range(10):
                for pin, shift in ((2, 0), (22, lag)):
                    rise = start + index * 20 * MS + shift
                    bench.pins += [
                        board.PinTransition(rise, pin, 1),
                        board.PinTransition(rise + 10 * MS, pin, 0),
                    ]
            for _ in range(6):
                bench.wait(50)
            assert (bench.state().left - before + 32768) % 65536 - 32768 == expected


def test_the_light():
    """Pin 13 is PB7."""
    with Emulator([(13, 14, 15)]) as emulator:
        from diffbotctl.links.diffbot_codec import encode

        emulator.step(30 * MS)
        lit = []
        for how in (1, 2, 2, 0):
            frame = encode(frames.ActionFrame(0, how))
            lit += emulator.step(emulator.now + 20 * MS, received=(frame, b"")).changes
        # The emulator reports the enable pin with both inputs low as braking.
        assert [change.shorted for change in lit] == [1.0, 0.0, 1.0, 0.0]


def test_the_emulator_compiles_without_a_cache(tmp_path):
    program = build(tmp_path)
    assert program.parent == tmp_path
    assert build(tmp_path) == program


@pytest.mark.parametrize("settings", [BOOK, UNO], ids=["mega2560", "uno"])
def test_frames_for_the_bootloader_do_no_harm(settings):
    """Right after a reset the stock bootloader reads the USB port.

    It stores a message of any length, also past the end of the chip's memory.
    """
    draw, board = Random(2), settings.board
    with Emulator(motor_pins(settings), board=board, boot=bootloader(board)) as emulator:
        for _ in range(1500):
            frame = encode_payload(draw.randbytes(draw.randint(1, 200)))
            step = emulator.step(emulator.now + draw.choice((1, 3, 10)) * MS, received=(frame, b""))
            assert step.changes == []
        emulator.reset(LINE)
        sent = b"".join(emulator.step(emulator.now + 100 * MS).bytes_of(0) for _ in range(30))
    assert any(isinstance(frame, frames.HelloFrame) for frame in FrameDecoder().feed(sent))
