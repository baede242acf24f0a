"""Bytes of lidars: by hand from the makers' manuals, in any portions, damaged, and of others."""

from math import inf, radians, sin, tan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diffbotctl.drivers.lidar import new_decoder, recognized
from diffbotctl.geometry.lidars import LIDARS
from diffbotctl.links.lidar_packets import YdlidarDecoder, crc8
from diffbotctl.links.lidar_turns import LidarAnswers, TurnCollector
from tests.support.usb_lidar import (
    DEGREES,
    SCAN_DESCRIPTOR,
    at_other_rate,
    lds01_turn,
    rplidar_turn,
    turn_of,
)

MODELS = [name for name in LIDARS if name != "ld19"]  # it is an LD06
CHECKED = [name for name in MODELS if LIDARS[name].protocol != "rplidar"]
# Models of one protocol, which differ in their baud rates.
ALIKE = ({"lds01"}, {"lds02", "ld06"}, {"rplidar_a1", "rplidar_c1"}, {"ydlidar_x2", "ydlidar_x4"})
# The example in the development manual of LD06 and LD19: 2152 degrees a second, 324.27 to 334.70
# degrees, 224 mm, 220 mm and so on.
LDROBOT_EXAMPLE = bytes.fromhex(
    "542c6808ab7ee000e4dc00e2d900e5d500e3d300e4d000e9cd00e4ca00e2c700e9c500e5c200e5c000e5be823a1a50"
)
LDROBOT_MILLIMETRES = [224, 220, 217, 213, 211, 208, 205, 202, 199, 197, 194, 192]
# Packet 0 of an LDS-01, as a public library for it has it: 301.1 rpm, 139 mm, 137 mm and so on.
LDS01_EXAMPLE = bytes.fromhex(
    "faa0c30bb0228b0000002c308900000042278a0000003c218c000000c60e980000003f16a40000001414"
)
# The zero packet in YDLIDAR's communication protocol.
YDLIDAR_EXAMPLE = bytes.fromhex("aa55010153ae53aeab540000")


class Samples:
    """Notes what a decoder adds, in place of a turn."""

    damaged = 0

    def __init__(self):
        self.added = []

    def add(self, angle, distance, bearing):
        self.added.append((angle, distance, bearing))

    def take(self):
        return []

    lose = take


def samples_of(model, data):
    """(angle, distance, bearing) of each sample in some bytes."""
    decoder = new_decoder(LIDARS[model])
    decoder.turns = Samples()
    decoder.receive(data)
    return decoder.turns.added, decoder.period


def begun(model):
    """What precedes the turns of a model."""
    return SCAN_DESCRIPTOR if LIDARS[model].protocol in ("rplidar", "ydlidar") else b""


def stream(model, distances):
    """The bytes of a turn for each distance, and the first of one more."""
    turns = [turn_of(model, (each,) * DEGREES) for each in (*distances, distances[-1])]
    return begun(model) + b"".join(turns)


def middle(turn):
    """A ray far from the seam between two turns."""
    return turn[len(turn) // 2]


def measured(model, distance):
    """What a model makes of a distance: the laser of an LDS-02 looks past its axis."""
    return pytest.approx(distance, abs=0.03 if model == "lds02" else 0.001)


def test_the_example_of_ldrobot():
    added, period = samples_of("ld06", LDROBOT_EXAMPLE)
    assert [round(1000 * distance) for _, distance, _ in added] == LDROBOT_MILLIMETRES
    assert (added[0][0], added[-1][0]) == (pytest.approx(324.27), pytest.approx(334.70))
    assert period == pytest.approx(360 / 2152)
    assert crc8(LDROBOT_EXAMPLE[:-1]) == 0x50


def test_the_example_of_an_lds01():
    added, period = samples_of("lds01", LDS01_EXAMPLE)
    assert added[0] == (0, 0.139, 0) and added[5] == (5, 0.164, 5) and len(added) == 6
    assert period == pytest.approx(60 / 301.1)


def test_the_example_of_ydlidar():
    [sample], _ = samples_of("ydlidar_x4", YDLIDAR_EXAMPLE)
    assert sample == (pytest.approx(0xAE53 // 2 / 64), 0.0, pytest.approx(0xAE53 // 2 / 64))


@pytest.mark.parametrize(("distance", "corrected"), [(1000, 217.0178), (8000, 235.6326)])
def test_the_angles_of_ydlidar(distance, corrected):
    """The manual's packet of 40 samples, whose angles are 223.78 and 243.47 degrees."""
    words = [0x55AA, 40 << 8, 0x6FE5, 0x79BD, *[4 * distance] * 40]
    checksum = 0
    for word in words:
        checksum ^= word
    words.insert(4, checksum)
    added, _ = samples_of("ydlidar_x2", b"".join(word.to_bytes(2, "little") for word in words))
    [bearing] = [b for _, _, b in (added[:1] if distance == 1000 else added[-1:])]
    assert bearing == pytest.approx(corrected, abs=0.01)


def test_the_laser_of_an_lds02_crosses_its_axis():
    """It starts 20.14 mm beside and 5.9 mm behind, and closes in by 0.11923 of the way: at 169 mm
    it meets the line straight ahead, far away it looks 6.8 degrees to the left."""
    packet = turn_of("lds02", (0.169,) * DEGREES)[:47]
    (angle, distance, bearing), *_ = samples_of("lds02", packet)[0]
    assert (angle, bearing) == (0.0, pytest.approx(0.0, abs=0.01))
    assert distance == pytest.approx(0.1749, abs=1e-4)
    (_, distance, bearing), *_ = samples_of("lds02", turn_of("lds02", (8.0,) * DEGREES)[:47])[0]
    assert bearing == pytest.approx(-6.66, abs=0.01)
    assert distance * sin(radians(-bearing)) == pytest.approx(8.0 * 0.11923 - 0.02014, abs=1e-3)


def test_a_sample_of_the_rplidar():
    # angle 90.5 deg is 5792 / 64; distance 1234.25 mm is 4937 / 4
    sample = bytes([0x3E, (5792 & 0x7F) << 1 | 1, 5792 >> 7, 4937 & 0xFF, 4937 >> 8])
    added, _ = samples_of("rplidar_a1", SCAN_DESCRIPTOR + sample)
    assert added == [(90.5, pytest.approx(1.23425), 90.5)]


@pytest.mark.parametrize("model", MODELS)
def test_rays_are_clockwise_from_the_zero_angle(model):
    distances = [2.0] * DEGREES
    for degree in range(85, 96):
        distances[degree] = 1.0
    turn, *_ = new_decoder(LIDARS[model]).receive(begun(model) + 2 * turn_of(model, distances))
    near = [DEGREES * ray / len(turn) for ray, distance in enumerate(turn) if distance < 1.5]
    assert len(turn) == LIDARS[model].rays and inf not in turn[3:-8]
    aside = 5.7 if model == "lds02" else 0.0  # at 1 m
    assert min(near) == pytest.approx(85 - aside, abs=1.6)
    assert max(near) == pytest.approx(95 - aside, abs=1.6)


@pytest.mark.parametrize("model", MODELS)
@settings(max_examples=15)
@given(cuts=st.lists(st.integers(1, 600), max_size=40))
def test_bytes_may_come_in_any_portions(model, cuts):
    decoder = new_decoder(LIDARS[model])
    data = stream(model, (0.5, 1.5))
    turns = []
    for cut in [*cuts, len(data)]:
        turns += decoder.receive(data[:cut])
        data = data[cut:]
    assert [middle(turn) for turn in turns] == [measured(model, 0.5), measured(model, 1.5)]
    assert decoder.turns.damaged == 0


@pytest.mark.parametrize("model", MODELS)
@settings(max_examples=20)
@given(start=st.integers(0, 1000), length=st.integers(45, 300))
def test_a_turn_with_a_lost_part_is_never_taken_for_whole(model, start, length):
    data = stream(model, (0.5, 1.0, 2.0))
    at = 400 + start  # within the first turn
    turns = new_decoder(LIDARS[model]).receive(data[:at] + data[at + length :])
    assert turns
    for turn in turns:
        inner = turn[len(turn) // 20 : -len(turn) // 20]
        assert max(inner) == pytest.approx(min(inner), abs=0.03)


@pytest.mark.parametrize("model", CHECKED)
@settings(max_examples=30)
@given(data=st.data())
def test_flipped_bits_give_no_wrong_ray(model, data):
    """One bit, or several within one byte, of any packets."""
    damaged = bytearray(stream(model, (1.0, 1.0)))
    for at in data.draw(st.lists(st.integers(0, len(damaged) - 1), max_size=5, unique=True)):
        damaged[at] ^= data.draw(st.integers(1, 255))
    decoder = new_decoder(LIDARS[model])
    if LIDARS[model].protocol == "lds01":  # a sum does not notice two errors that cancel out
        damaged = bytearray(stream(model, (1.0, 1.0)))
        damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= data.draw(st.integers(1, 255))
    for turn in decoder.receive(bytes(damaged)):
        assert all(distance in (inf, measured(model, 1.0)) for distance in turn)


@pytest.mark.parametrize("model", MODELS)
@settings(max_examples=15)
@given(noise=st.binary(max_size=3000))
def test_noise_ends_nothing(model, noise):
    decoder = new_decoder(LIDARS[model])
    decoder.receive(noise)
    turns = decoder.receive(bytes(300) + stream(model, (1.0,) * 4))
    assert turns and middle(turns[-1]) == measured(model, 1.0)


@pytest.mark.parametrize("model", MODELS)
def test_a_lidar_is_recognized_by_what_it_sends(model):
    same = [name for name in LIDARS if name == model or {name, model} == {"ld06", "ld19"}]
    assert recognized(stream(model, (1.0,))[:4096], LIDARS[model].baud) == same
    for other in {each.baud for each in LIDARS.values()} - {LIDARS[model].baud}:
        garbled = at_other_rate(stream(model, (1.0,)), LIDARS[model].baud, other)
        assert len(garbled) > 500 and recognized(garbled, other) == []


@pytest.mark.parametrize("other", MODELS)
@pytest.mark.parametrize("model", MODELS)
def test_no_lidar_passes_for_another(model, other):
    """An X2 begins with the descriptor of an A1. Some differ in their baud rates only."""
    if any({model, other} <= alike for alike in ALIKE):
        return
    decoder = new_decoder(LIDARS[model])
    assert decoder.receive(SCAN_DESCRIPTOR + stream(other, (1.0, 2.0, 3.0))) == []
    assert decoder.packets < 3


def test_answers_about_health():
    answers = LidarAnswers()
    for byte in b"noise" + bytes.fromhex("a55a0300000006 02 0480") + b"x":
        answers.receive(bytes([byte]))
    assert (answers.status, answers.code, answers.has_started) == (2, 0x8004, False)
    answers.receive(SCAN_DESCRIPTOR)
    assert answers.has_started


def test_a_ray_without_a_sample_gets_the_nearer_neighbour():
    """Three samples for each five rays."""
    turns = TurnCollector(600)
    for number in range(2 * 360 + 1):
        turns.add(number % 360, 1.0 if number % 360 < 180 else 3.0, number % 360)
    first, second = turns.take()
    assert first == second and set(first) == {1.0, 3.0}
    assert first.count(1.0) - first.count(3.0) in (2, 3, 4)  # at both borders


def test_a_slow_step_back_is_no_loss():
    """The angles of an RPLIDAR are not quite in order."""
    turns = TurnCollector(360)
    for number in range(2 * 720 + 6):
        angle = (number / 2 + (-0.7 if number % 2 else 0.0)) % 360.0
        turns.add(angle, 1.0, angle)
    assert len(turns.take()) == 2 and turns.damaged == 0


def test_tangent_of_the_manual():
    """The correction is the angle at which a laser 21.8 mm beside the axis sees the object, from
    the one at 155.3 mm, where both lines cross."""
    decoder = YdlidarDecoder(360)
    assert decoder.offset / decoder.focus == pytest.approx(tan(radians(7.99)), abs=1e-3)


def test_the_seam_of_an_lds01_and_an_rplidar():
    for make, model in ((lds01_turn, "lds01"), (rplidar_turn, "rplidar_a1")):
        distances = [0.0] * DEGREES
        distances[0], distances[90] = 1.0, 0.5
        [turn] = new_decoder(LIDARS[model]).receive(begun(model) + make(distances) * 2)[:1]
        assert (turn[0], turn[90], turn[270]) == (1.0, 0.5, inf)
