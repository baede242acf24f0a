"""`bag play`: recorded messages into declared inputs, and what is refused."""

import signal
import subprocess

import pytest

from tests.support.running import PlainClient, cli, command, release, running, stands

PIPELINE = """
format: 1
kind: pipeline
include: goal
goals: []
inputs:
  pose: {type: Odometry, timeout: 1 s}
  lead: {type: Twist, timeout: 0.5 s}
blocks:
  mux: {in: {autonomous: input.lead}}
"""


BOTH = ("--map", "odometry.odometry=input.pose", "--map", "follower.twist=input.lead")


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """A folder with a recording of 3 s and an engine whose inputs can take parts of it."""
    folder = tmp_path_factory.mktemp("play")
    pipeline = folder / "inputs.yaml"
    pipeline.write_text(PIPELINE)
    words = ("--fast", "--for", "3s", "--quiet", "--record", folder / "a.mcap")
    assert cli(folder, "run", "goal", *words)[0] == 1  # the goal is farther away
    with running(folder, str(pipeline), "--stay"):
        yield folder


def play(folder, *words):
    return cli(folder, "bag", "play", folder / "a.mcap", *words)


def test_a_topic_is_played_at_a_rate_into_an_input(engine):
    release(engine)
    client = PlainClient(engine)
    before = client.request("topic_rate", topic="input.pose")["messages"]
    code, printed, complaints = play(engine, "--map", "odometry.odometry=input.pose", "--rate", 2)
    assert code == 0, complaints
    count = int(printed.split()[0])
    reply = client.request("topic_rate", topic="input.pose")
    assert reply["messages"] - before == count > 50
    last = client.request("describe_topic", topic="input.pose")["last"]
    end = cli(engine, "bag", "export", engine / "a.mcap", "odometry.odometry.x")[1].split(",")[-1]
    assert last["x"] == float(end)
    assert client.request("status")["held"] is None  # nothing depends on it


def test_a_loop_goes_on_until_it_is_interrupted(engine):
    words = ("bag", "play", engine / "a.mcap", "--loop", "--rate", 4)
    line, environment = command(engine, *words, "--map", "odometry.odometry=input.pose")
    client = PlainClient(engine)
    before = client.request("topic_rate", topic="input.pose")["messages"]
    with subprocess.Popen(line, env=environment, stderr=subprocess.DEVNULL) as process:
        client.until(
            lambda status: (
                client.request("topic_rate", topic="input.pose")["messages"] > before + 250
            )  # of about 110 in the recording
        )
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130


def test_an_input_that_feeds_motion_needs_drive_and_stops_the_robot_at_its_end(engine):
    release(engine)
    code, _, complaints = play(engine, "--map", "follower.twist=input.lead")
    assert code == 2 and "--drive" in complaints
    client = PlainClient(engine)
    assert stands(client.request("status"))
    code, _, complaints = play(engine, "--map", "follower.twist=input.lead", "--drive")
    assert code == 0, complaints
    held = client.until(lambda status: status["held"])["held"]
    assert held["code"] == "input_stale" and "bag play" in held["cause"]
    client.until(stands)
    assert abs(client.request("describe_topic", topic="odometry.odometry")["last"]["x"]) > 0.05


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--map", "operator.goal=operator.goal"), "only into what `inputs`"),
        (("--map", "gate.stop=operator.resume"), "only into what `inputs`"),
        (("--map", "gate.wheels=robot.wheels", "--drive"), "only into what `inputs`"),
        (("--map", "odometry.odometry"), "no TOPIC=INPUT"),
        ((), "--map"),
        (("--map", "odometry.odometri=input.pose"), "did you mean odometry.odometry?"),
        (("--map", "odometry.odometry=input.lead", "--drive"), "of type Odometry, not Twist"),
        (("--map", "odometry.odometry=input.nothing"), "E-REQUEST"),
        ((*BOTH, "--rate", "100", "--drive"), "lower --rate"),
        (("--map", "odometry.odometry=input.pose", "--rate", "20", "--loop"), "lower --rate"),
    ],
)
def test_what_is_refused(engine, words, said):
    code, _, complaints = play(engine, *words)
    assert code in (1, 2) and said in " ".join(complaints.split())
