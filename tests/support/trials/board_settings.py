"""Trials of the binary's settings: unusable ones, and power that fails while they are written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random
from typing import NamedTuple

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_settings import WheelSettings
from diffbotctl.time import MILLISECOND as MS
from tests.support.board_bench import RADIO, BoardBench, trial_board
from tests.support.trials.row import Row


def refused_settings(seed: int, count: int) -> Iterator[Row]:
    """Settings with one field spoilt at random: refused with a code, and the old ones kept."""
    rng = Random(seed)
    wrong = kept = refused = 0
    with BoardBench() as bench:
        bench.ready()
        mark = trial_board().settings.mark()
        for _ in range(count):
            bad = spoil(rng)
            answer = bench.configure(bad)
            refused += answer.refusal != 0
            wrong += answer.refusal == 0
            kept += answer.settings == mark
        still = bench.ask().settings == mark
    yield Row("unusable settings refused", f"{refused} of {count}", "all", wrong == 0)
    yield Row("old settings kept", f"{kept} of {count}", "all", kept == count and still)


class PinSets(NamedTuple):
    """Pins of a board, by hand from its drawing; `digital`: how many, `first`: A0."""

    links: set[int]
    pwm: set[int]
    interrupts: set[int]
    digital: int
    first: int
    analogs: int


PINS = {
    frames.BoardCode.MEGA2560: PinSets(
        {0, 1, 18, 19}, {*range(2, 11), 13, 44, 45, 46}, {2, 3, 20, 21}, 70, 54, 16
    ),
    frames.BoardCode.ATMEGA328P: PinSets({0, 1}, {5, 6, 9, 10}, {2, 3}, 20, 14, 8),
    frames.BoardCode.RP2040: PinSets({0, 1}, {*range(2, 23)}, {*range(2, 23)}, 29, 26, 3),
}


def spoil(rng: Random) -> frames.SettingsFrame:
    """The book robot's settings, one field of them unusable."""
    settings = trial_board().settings
    good, pins = settings.frame(), PINS[settings.board]
    used = {pin for side in (settings.left, settings.right) for pin in _pins_of(side)}
    missing = {*range(pins.digital, 255)}
    no_pwm = {*range(pins.digital)} - pins.pwm
    no_interrupt = {*range(pins.digital)} - pins.interrupts
    mandatory = {
        "left_enable": no_pwm,
        "right_enable": no_pwm,
        "left_encoder": no_interrupt,
        "right_encoder": no_interrupt,
    }
    choices: dict[str, list[int]] = {}
    for field in (
        "left_enable",
        "left_in1",
        "left_in2",
        "left_encoder",
        "right_enable",
        "right_in1",
        "right_in2",
        "right_encoder",
    ):
        bad = pins.links | missing | (used - {getattr(good, field)})
        bad |= set() if field.endswith("encoder") else {255}  # a motor may have no encoder
        choices[field] = sorted(bad | mandatory.get(field, set()) - {getattr(good, field)})
    for field in ("left_encoder_b", "right_encoder_b", "button"):
        choices[field] = sorted(pins.links | missing | used | {pins.first})  # the range sensor's
    choices["range"] = [*range(pins.analogs, 255)]
    choices["battery"] = [0, *range(pins.analogs, 255)]
    choices["edge"] = [0]
    choices["reserved"] = [1]
    choices["every_edge"] = [1]  # without channel B
    choices["baud"] = [*range(5, 256)]
    choices["telemetry"] = [0, 101, 40_000, 65_535]
    choices["left_slots"] = choices["right_slots"] = [0]
    # 1 and 2 have other pins; 3 may have these.
    choices["driver"] = [1, 2, *range(frames.DriverCode.PULSED_INPUTS + 1, 256)]
    choices["standby"] = sorted(pin + 1 for pin in used | pins.links | missing - {254})
    choices["battery_low"] = [frames.ANALOG_ONE + 1, 65_535]
    choices["glitch"] = [50_001, 65_535]
    choices["deadman"] = [0, 1, 99, 501, 65_535]
    for field in (
        "left_start",
        "left_gain",
        "left_proportional",
        "left_integral",
        "right_start",
        "right_gain",
        "right_proportional",
        "right_integral",
    ):
        choices[field] = [frames.GAIN_MAXIMUM + 1, 32_768, 65_535]
    field = rng.choice(sorted(choices))
    return good._replace(**{field: rng.choice(choices[field])})


def _pins_of(side: WheelSettings) -> tuple[int, ...]:
    assert side.enable is not None and side.in2 is not None, "an L298N's"
    assert side.encoder is not None
    return side.enable, side.in1, side.in2, side.encoder


def eeprom_cuts(seed: int, count: int) -> Iterator[Row]:
    """Power fails while settings are written, at every byte; that byte is left at random."""
    rng = Random(seed)
    new = replace(trial_board().settings, glitch=3 * MS)
    shots: list[tuple[bytes, bytes]] = []
    with BoardBench() as bench:
        bench.ready()
        bench.wait(500)
        before = bench.emulator.eeprom()
        bench.send(RADIO, new.frame())
        for _ in range(300):
            bench.wait(1)
            after = bench.emulator.eeprom()
            if after != before:
                shots.append((before, after))
                before = after
    marks = {trial_board().settings.mark(), new.mark()}
    valid = 0
    cuts = [shots[index * len(shots) // count % len(shots)] for index in range(count)]
    for old, written in cuts:
        place = next(i for i in range(len(old)) if old[i] != written[i])
        torn = old[:place] + bytes([rng.randrange(256)]) + old[place + 1 :]
        with BoardBench(eeprom=torn) as bench:
            bench.wait(30)
            valid += bench.ask().settings in marks
    yield Row.counted(
        f"EEPROM of {len(shots)} written bytes, cut at {count} places: a valid slot",
        valid,
        len(cuts),
    )
