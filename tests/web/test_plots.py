"""The numbers that a page plots: which fields it may choose, and what it gets of them."""

import asyncio
from itertools import pairwise
from math import nan

import pytest

from diffbotctl.control_socket.protocol import RefusalError
from diffbotctl.web.page_commands import plotted_fields, read_request
from diffbotctl.web.plot_samples import FIELDS_MAX, SAMPLES_MAX, PlotSamples
from tests.support.page_server import serving
from tests.support.plain_page import PlainPage
from tests.support.running import running

SECOND = 1_000_000_000


def test_history_comes_before_the_samples_of_the_stream():
    samples = PlotSamples()
    assert samples.choose(["a.twist.linear"]) == ["a.twist.linear"]
    samples.add_history("a.twist.linear", [(0.1, 1.0), (0.2, 2.0)])
    samples.take("a.twist", {"time": SECOND // 2, "linear": 1 / 3, "angular": 7.0})
    samples.take("b.twist", {"time": SECOND, "linear": 9.0})
    assert samples.drain() == {"a.twist.linear": [0.1, 1.0, 0.2, 2.0, 0.5, 0.333333]}
    assert samples.drain() == {}


@pytest.mark.parametrize(
    "value, plotted",
    [
        (True, 1.0),  # a flag
        (3, 3.0),
        ("nan", None),  # as the engine writes what is no number
        (nan, None),
        (None, None),
        ("up", None),
        ([1.0], None),
        (10**400, None),  # no double can hold it
        (-1e308, None),  # differences to it overflow
    ],
)
def test_what_is_no_number_is_a_gap(value, plotted):
    samples = PlotSamples()
    samples.choose(["a.b.c"])
    samples.take("a.b", {"time": SECOND, "c": value})
    samples.take("a.b", {"time": 2 * SECOND})
    assert samples.drain() == {"a.b.c": [1.0, plotted, 2.0, None]}


def test_another_choice_keeps_what_waits_and_drops_the_rest():
    samples = PlotSamples()
    samples.choose(["a.b.c", "a.b.d"])
    samples.take("a.b", {"time": SECOND, "c": 1, "d": 2})
    assert samples.choose(["a.b.d", "e.f.g"]) == ["e.f.g"]
    assert samples.topics == {"a.b", "e.f"}
    assert samples.drain() == {"a.b.d": [1.0, 2.0]}
    assert samples.choose([]) == [] and samples.topics == set()


def test_samples_of_a_page_that_reads_nothing_are_bounded():
    samples = PlotSamples()
    samples.choose(["a.b.c"])
    for number in range(3 * SAMPLES_MAX):
        samples.take("a.b", {"time": number * SECOND, "c": number})
    drained = samples.drain()["a.b.c"]
    assert len(drained) == 2 * SAMPLES_MAX and drained[-1] == 3 * SAMPLES_MAX - 1


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"fields": "gate.wheels.left"},
        {"fields": [["gate.wheels.left"]]},
        {"fields": [None]},
        {"fields": ["gate.wheels.left"] * (FIELDS_MAX + 1)},
        {"fields": ["gate.wheels" + "l" * 300]},
        {"fields": ["*.left"]},
        {"fields": ["left"]},
        {"fields": [""]},
    ],
)
def test_a_choice_of_no_topic_of_the_run_is_refused(fields):
    with pytest.raises(RefusalError):
        plotted_fields(fields, {"gate.wheels"})


def test_a_choice_names_each_field_once():
    names = ["gate.wheels.left", "gate.wheels.right", "gate.wheels.left"]
    assert plotted_fields({"fields": names}, {"gate.wheels"}) == names[:2]
    assert plotted_fields({"fields": []}, set()) == []


@pytest.mark.parametrize("topic", [None, 7, "t" * 1000])
def test_a_description_needs_the_name_of_a_topic(topic):
    with pytest.raises(RefusalError):
        read_request({"method": "describe_topic", "topic": topic})


SAMPLES_READ_MAX = 10_000
PICTURES_GAP_S = 0.1  # between two pictures; the encoders of this robot come every 0.02 s


async def dense_times(page, name):
    """Read samples of a field until two are closer than pictures; returns all times."""
    times = []
    while not any(b - a < PICTURES_GAP_S / 2 for a, b in pairwise(times)):
        assert len(times) < SAMPLES_READ_MAX
        message = await page.until(lambda fields: name in fields.get("plot", ()))
        times += message["plot"][name][::2]
    return times


def test_a_page_gets_every_sample_and_the_units(tmp_path):
    async def run(server):
        async with PlainPage(server, server.enter(server.next_link())) as page:
            await page.send(do="plot", fields=["robot.encoders.left"])
            times = await dense_times(page, "robot.encoders.left")
            await page.send(do="plot", fields=["nothing.at.all"])
            refused = await page.until(lambda fields: "refused" in fields)
            await page.send(do="plot", fields=[])
            await page.send(do="read", method="describe_topic", topic="gate.wheels")
            reply = await page.until(lambda fields: "read" in fields)
            return times, refused["refused"], reply["reply"]["schema"]["properties"]

    with running(tmp_path, "standby", "--stay"), serving(tmp_path) as server:
        times, refused, properties = asyncio.run(run(server))
    assert times == sorted(times)
    assert "no topic nothing.at" in refused
    assert properties["left"]["x-unit"] == "rad/s"
