"""The firmware of a Pico on its emulated chip: what the other boards show, and what only it has."""

import shutil
from dataclasses import replace

import pytest

from diffbotctl.config.board_pins import BOARDS
from diffbotctl.config.checks.pins import pins_for, serial_pins
from diffbotctl.emulator import program
from diffbotctl.emulator.process import BROWNOUT, POWER, Emulator, PinTransition
from diffbotctl.emulator.program import EmulatorError
from diffbotctl.flash.uf2 import is_rp2040
from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_settings import RangeInput
from tests.sampling import by_day
from tests.support.board_bench import MS, PICO, PICO_BOARD, RADIO, BoardBench, speed, trials_on
from tests.support.trials import (
    board,
    board_faults,
    board_restarts,
    board_runs,
    board_settings,
    frame_damage,
)

PINS = BOARDS["pico"]
SLOT = 128  # bytes of one in the store


DAY = {
    "latency": lambda: board.latency(3, 20),
    "edges": lambda: board.edges(20_000, 0.2),
    "settings": lambda: board_settings.refused_settings(3, 25),
    "deadman": lambda: board.deadman(3, 12),
}
NIGHT = {
    "telemetry": lambda: board.telemetry(5),
    "bounce": lambda: board.bounce(3, 1),
    "restarts": lambda: board.restarts(3, 3),
    # few storms end by a stop frame, the third row
    "encoder storms": lambda: list(board_faults.storms(3, 3))[:2],
    "hello after a reset": lambda: board_faults.hellos(3, 5),
    "damage": lambda: frame_damage.through_binary(3, 60),
    "speed loop": lambda: board_runs.agreement(3, 1),
    "same twice": lambda: board_runs.same_twice(3),
    "restarts under a goal": lambda: board_restarts.rows(3, 1),
}


@pytest.mark.parametrize("name", by_day(len(DAY), DAY | NIGHT))
def test_figures(name):
    with trials_on(PICO_BOARD):
        for row in (DAY | NIGHT)[name]():
            assert row.met, row


@pytest.mark.nightly
def test_a_goal_is_reached():
    with trials_on(PICO_BOARD):
        for row in board_runs.goals(3, 1):
            if "median" not in row.what:  # one robot has no median
                assert row.met, row


def test_each_driver_is_driven():
    """Full duty forward and half of it backward, then the brake, at each kind of inputs."""
    plain = replace(PICO, left=replace(PICO.left, reversed=False))
    two_pwm = replace(
        plain,
        driver=frames.DriverCode.TWO_PWM,
        left=replace(plain.left, enable=None),
        right=replace(plain.right, enable=None, in1=9, in2=10),
    )
    direction = replace(
        plain,
        driver=frames.DriverCode.ENABLE_DIRECTION,
        left=replace(plain.left, in2=None),
        right=replace(plain.right, in2=None),
    )
    for settings in (plain, two_pwm, direction, replace(plain, standby=20)):
        with BoardBench(settings=replace(settings, brake=True)) as bench:
            bench.ready()
            bench.turn(1)
            bench.send(RADIO, frames.DutyFrame(1, 32767, -16384))
            bench.wait(30)
            assert bench.duty == pytest.approx([1.0, -0.5], abs=0.004), settings.driver
            bench.send(RADIO, frames.StopFrame(2))
            bench.wait(30)
            assert bench.duty == [0.0, 0.0]
            assert [change.shorted for change in bench.changes[-2:]] == [1.0, 1.0]


@pytest.mark.parametrize("role", ["pwm", "interrupt", "digital"])
def test_the_board_takes_the_pins_of_the_host_s_table(role):
    """Each number from 0 to 31 in one place of the settings, the others out of its way."""
    serial = serial_pins(PINS, 0, "diffbot")
    expected = {PINS.number(pin) for pin in pins_for(PINS, role, "diffbot") if pin not in serial}
    taken = set()
    with BoardBench(settings=PICO) as bench:
        bench.wait(400)  # so long the wheels must have stood for new settings
        for pin in range(32):
            settings = _with_pin(role, pin)
            if bench.configure(settings).refusal == frames.RefusalCode.NONE:
                taken.add(pin)
    if role == "digital":  # the pin of the LED, which is on no header
        taken -= {25}
    assert taken == expected


def _with_pin(role, pin):
    """Settings with `pin` in this role, and no other use of it, of its PWM output or its kind."""
    others = [each for each in range(2, 14) if each not in (pin, pin % 16)]
    left_enable, left_1, left_2, right_enable, right_1, right_2, left_edge, right_edge, *_ = others
    pins = replace(
        PICO,
        range_channel=None,
        left=replace(PICO.left, enable=left_enable, in1=left_1, in2=left_2, encoder=left_edge),
        right=replace(
            PICO.right, enable=right_enable, in1=right_1, in2=right_2, encoder=right_edge
        ),
    )
    if role == "pwm":
        return replace(pins, left=replace(pins.left, enable=pin))
    if role == "interrupt":
        return replace(pins, left=replace(pins.left, encoder=pin))
    return replace(pins, button=pin)


def test_two_pins_with_one_pwm_output_are_refused():
    """5 and 21 are both channel B of slice 2."""
    with BoardBench(settings=PICO) as bench:
        bench.wait(30)
        answer = bench.configure(replace(PICO, right=replace(PICO.right, enable=21)))
        assert answer.refusal == frames.RefusalCode.PIN_TWICE
        assert frames.SettingsFrame._fields[answer.field] == "right_enable"


def test_an_echo_on_an_analog_pin_is_refused():
    with BoardBench(settings=PICO) as bench:
        bench.wait(30)
        inputs = (RangeInput("back", 27, 12),)
        answer = bench.configure(replace(PICO, further_ranges=inputs))
        assert answer.refusal == frames.RefusalCode.PIN_INTERRUPT


def test_settings_survive_without_power():
    with BoardBench(settings=PICO) as bench:
        bench.ready()
        bench.wait(200)
        boots = []
        for _ in range(3):
            bench.emulator.reset(POWER)
            bench.wait(30)
            hello = bench.ask()
            assert (hello.settings, hello.reset) == (PICO.mark(), frames.ResetCode.POWER)
            boots.append(hello.boot)
        assert len(set(boots)) == 3
        assert bench.emulator.dirty_writes() == 0


def test_a_dip_of_the_supply_is_distinguished_from_power_on():
    with BoardBench(settings=PICO) as bench:
        bench.wait(30)
        bench.emulator.reset(BROWNOUT)
        bench.wait(30)
        assert bench.ask().reset == frames.ResetCode.BROWNOUT


@pytest.mark.parametrize("written", by_day(1, (28, 0, 7, 14, 21, 35, 42, 49, 56)))
def test_power_that_fails_while_settings_are_written_leaves_a_valid_slot(written):
    """After the sector of the older slot was erased, and after some of its bytes, from the end."""
    new = replace(PICO, glitch=3 * MS)
    with BoardBench(settings=PICO) as bench:
        bench.ready()
        bench.wait(200)
        before = bench.emulator.eeprom()
        assert bench.configure(new).refusal == frames.RefusalCode.NONE
        bench.wait(200)
        after = bench.emulator.eeprom()
    slot = 0 if before[:SLOT] != after[:SLOT] else 1
    start = slot * SLOT
    size = next(n for n in range(SLOT, 0, -1) if after[start + n - 1] != 0xFF)
    torn = bytearray(before)
    torn[start : start + SLOT] = b"\xff" * SLOT
    kept = min(written, size - 1)
    torn[start + size - kept : start + size] = after[start + size - kept : start + size]
    with BoardBench(eeprom=bytes(torn), settings=PICO) as bench:
        bench.wait(30)
        assert bench.ask().settings == PICO.mark()


def test_driving_goes_on_while_the_flash_erases():
    """The program runs from RAM: telemetry has no gap, and the dead-man time is kept."""
    new = replace(PICO, glitch=3 * MS)
    with BoardBench(settings=PICO) as bench:
        bench.ready()
        bench.wait(400)
        assert bench.configure(new).refusal == frames.RefusalCode.NONE
        bench.claim()
        bench.turn(1)
        bench.received.clear()
        start = bench.now
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(400)
        states = [h.time for h in bench.received if isinstance(h.frame, frames.StateFrame)]
        assert len(states) >= 15
        assert bench.duty == [0.0, 0.0]
        assert bench.changes[-1].time - start < 320 * MS


def test_the_stop_button_and_its_pull_up():
    with BoardBench(settings=replace(PICO, button=20)) as bench:
        bench.ready()
        bench.turn(2)
        bench.send(RADIO, speed(1, 5, 5))
        bench.wait(20)
        assert min(bench.duty) > 0.5  # the open pin is high
        bench.pins.append(PinTransition(bench.now + MS, 20, 0))
        bench.wait(6)
        assert bench.duty == [0.0, 0.0]


def test_range_is_on_the_scale_of_the_other_boards():
    with BoardBench(settings=PICO) as bench:
        bench.ready()
        for millivolts in (0, 500, 1600, 3290):
            bench.run(bench.now + 120 * MS, {0: millivolts})
            # a reading of 4.9 mV is truncated
            assert bench.state().range == pytest.approx(millivolts / 5000 * 4092, abs=5)


def test_a_program_whose_boot_code_is_damaged_is_not_started(tmp_path):
    image = bytearray(program.image_of(frames.BoardCode.RP2040).read_bytes())
    image[40] ^= 1
    damaged = tmp_path / "damaged.uf2"
    damaged.write_bytes(image)
    assert not is_rp2040(bytes(image))
    with Emulator([], board=frames.BoardCode.RP2040, image=damaged) as emulator:
        assert emulator.step(50 * MS).sent == []


def test_missing_parts_of_the_emulator_are_listed(monkeypatch, tmp_path):
    monkeypatch.setattr(program, "RP2040", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(EmulatorError) as raised:
        Emulator([], board=frames.BoardCode.RP2040)
    assert "npm ci" in raised.value.problems[0].fix
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(EmulatorError) as raised:
        Emulator([], board=frames.BoardCode.RP2040)
    assert "nodejs" in raised.value.problems[0].fix
