"""The book's turtle and the Burger, commanded from another terminal as its chapters 4 and 5 do."""

import json
import signal
import time
from math import pi

import pytest

from tests.support.background import repeating
from tests.support.running import REPLY_TIMEOUT_S, PlainClient, cli, release, running


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A turtle that waits on its field."""
    there = tmp_path_factory.mktemp("turtle")
    with running(there, "turtle"):
        yield there


@pytest.fixture(autouse=True)
def released(folder):
    release(folder)


def done(folder, *words):
    """Run a command that must succeed."""
    code, output, complaint = cli(folder, *words)
    while "E-HELD" in complaint:  # a computer that stands still stops the robot at any time
        release(folder)
        code, output, complaint = cli(folder, *words)
    assert code == 0, complaint
    return output


def last(folder, topic):
    """The newest message of a topic."""
    return json.loads(done(folder, "topic", "echo", topic, "--once", "--json"))


def becomes(folder, topic, holds):
    """Wait until the newest message of `topic` satisfies `holds`: at its next frame, at most."""
    until = time.monotonic() + REPLY_TIMEOUT_S
    while not holds(found := last(folder, topic)):
        assert time.monotonic() < until, f"{topic} stays {found}"
    return found


def test_it_starts_in_the_middle_of_its_field(folder):
    at = last(folder, "robot.pose")
    assert (at["x"], at["y"], at["heading"]) == pytest.approx((5.544, 5.544, 0.0))


def test_it_is_driven_by_hand_for_a_distance(folder):
    done(folder, "call", "robot.home")
    code, output, complaint = cli(folder, "drive", "--v", "0.5", "--distance", "1m")
    assert code == 0, complaint
    assert float(output.split()[1]) == pytest.approx(1.0, abs=0.05)
    at = becomes(folder, "robot.pose", lambda pose: pose["linear"] == 0.0)
    assert at["x"] == pytest.approx(6.544, abs=0.05)
    assert at["y"] == pytest.approx(5.544, abs=0.01)


def test_it_is_sent_to_a_place_of_the_field(folder):
    done(folder, "call", "robot.teleport", "x=3", "y=3")
    done(folder, "goto", "4", "4")
    at = becomes(folder, "robot.pose", lambda pose: pose["x"] > 3.9 and pose["linear"] == 0.0)
    assert (at["x"], at["y"]) == pytest.approx((4.0, 4.0), abs=0.1)


def test_it_is_teleported(folder):
    done(folder, "call", "robot.teleport", "x=1", "y=2", "heading=90deg")
    at = becomes(folder, "robot.pose", lambda pose: pose["x"] == 1.0)
    assert (at["y"], at["heading"]) == pytest.approx((2.0, pi / 2))
    done(folder, "call", "robot.hop", "distance=1", "turn=-90deg")
    at = becomes(folder, "robot.pose", lambda pose: pose["x"] > 1.5)
    assert (at["x"], at["y"], at["heading"]) == pytest.approx((2.0, 2.0, 0.0))


def test_its_colours_are_parameters(folder):
    done(folder, "param", "set", "canvas.background_red", "200")
    done(folder, "param", "set", "canvas.pen", "up")
    looks = becomes(folder, "canvas.canvas", lambda sheet: not sheet["is_down"])
    assert looks["background"] == "#c856ff"
    assert cli(folder, "param", "set", "canvas.background_red", "256")[0] != 0


def test_others_are_spawned_moved_killed_and_the_sheet_is_wiped(folder):
    done(folder, "call", "canvas.spawn", "x=2", "y=3", "heading=90deg")
    becomes(folder, "canvas.canvas", lambda sheet: sheet["turtles"] == [2, 2, 3, pi / 2])
    done(folder, "call", "canvas.teleport", "name=turtle2", "x=9", "y=8")
    becomes(folder, "canvas.canvas", lambda sheet: sheet["turtles"] == [2, 9, 8, 0])
    code, _, complaint = cli(folder, "call", "canvas.kill", "name=turtle7")
    assert code == 1 and "no turtle called 'turtle7'" in complaint
    done(folder, "call", "canvas.kill", "name=turtle2")
    done(folder, "call", "canvas.clear")
    becomes(folder, "canvas.canvas", lambda sheet: sheet["turtles"] == [] and sheet["sheet"] == 1)
    done(folder, "call", "canvas.spawn", "x=2")
    code, _, complaint = cli(folder, "call", "robot.teleport", "x=20")
    assert code == 1 and "x is 0 to 11.09 m in the field; it is 20 m" in complaint
    done(folder, "call", "robot.teleport", "x=9")
    for word in ("/reset", "reset"):
        assert done(folder, "call", word) == "robot.home: done\ncanvas.start_over: done\n"
    becomes(folder, "canvas.canvas", lambda sheet: sheet["turtles"] == [] and sheet["sheet"] == 3)
    becomes(folder, "robot.pose", lambda pose: pose["x"] < 9)


def test_turtle_1_is_killed_and_comes_back(folder):
    done(folder, "call", "canvas.kill", "name=turtle1")
    assert "turtle1 was killed" in done(folder, "why")
    becomes(folder, "canvas.canvas", lambda sheet: not sheet["has_first"])
    before = last(folder, "robot.pose")
    cli(folder, "drive", "--v", "0.5", "--for", "0.5s")
    after = last(folder, "robot.pose")
    assert (after["x"], after["y"]) == (before["x"], before["y"])
    assert done(folder, "call", "canvas.spawn", "name=turtle1") == "canvas.spawn: turtle1\n"
    done(folder, "drive", "--v", "0.5", "--distance", "0.3m")
    becomes(folder, "robot.pose", lambda pose: pose["x"] != before["x"])


def test_the_colour_sensor_sees_the_line_of_a_wide_pen(folder):
    for name, value in (("background_red", 0), ("background_green", 0), ("background_blue", 9)):
        done(folder, "param", "set", f"canvas.{name}", str(value))
    done(folder, "call", "reset")
    done(folder, "param", "set", "canvas.pen", "up")
    seen = becomes(folder, "/turtle1/color_sensor", lambda color: color["blue"] == 9)
    assert (seen["red"], seen["green"]) == (0, 0)
    for name, value in (("pen_red", "250"), ("pen_width", "20cm"), ("pen", "down")):
        done(folder, "param", "set", f"canvas.{name}", value)
    done(folder, "drive", "--v", "0.5", "--distance", "0.5m")
    done(folder, "param", "set", "canvas.pen", "up")
    done(folder, "call", "robot.teleport", "x=5.7", "y=5.6")  # beside the line, within its width
    becomes(folder, "robot.pose", lambda pose: pose["x"] == pytest.approx(5.7))
    becomes(folder, "color.color", lambda color: color["red"] == 250)
    done(folder, "call", "robot.teleport", "x=5.7", "y=5.9")
    becomes(folder, "color.color", lambda color: color["red"] == 0)
    code, _, complaint = cli(folder, "call", "/turtle1/set_pen", "r=1")
    assert code == 1 and "param set canvas.pen_red" in " ".join(complaint.split())


def test_the_turtlebot_wanders_and_manual_driving_has_priority(tmp_path):
    with running(tmp_path, "wander"):
        becomes(tmp_path, "odometry.odometry", lambda pose: pose["linear"] > 0.1)
        scan = last(tmp_path, "robot.scan")
        assert len(scan["distances"]) == 360
        output = done(tmp_path, "drive", "--v", "0.1", "--distance", "20cm")
        assert 0.15 < float(output.split()[1]) < 0.30  # it came with 0.176 m/s


def publishing(client, topic, **message):
    """`client` publishes the message 20 times a second, from a thread, until the end."""
    line = json.dumps({"method": "publish", "topic": topic, "message": message})
    return repeating(lambda: client.send(line), 0.05)


@pytest.mark.nightly
def test_spawned_turtles_are_driven_at_once_and_replayed(tmp_path):
    recording = tmp_path / "turtles.mcap"
    with running(tmp_path, "turtles", "--record", str(recording), sets=()) as process:
        done(tmp_path, "call", "canvas.spawn", "x=2", "y=3")
        done(tmp_path, "call", "canvas.spawn", "x=8", "y=3", "heading=90deg")
        done(tmp_path, "call", "canvas.spawn", "x=9", "y=9")
        becomes(tmp_path, "turtle4.pose", lambda pose: pose["x"] == 9.0)
        people = [PlainClient(tmp_path) for _ in range(3)]
        with (
            publishing(people[0], "/turtle2/cmd_vel", linear=0.5, angular=0.0),
            publishing(people[1], "/turtle3/cmd_vel", linear=0.5, angular=0.0),
            publishing(people[2], "/turtle1/cmd_vel", linear=0.5, angular=0.0),
        ):
            words = ("topic", "pub", "/turtle4/goal", '{"x": 6, "y": 9}')
            done(tmp_path, *words)
            becomes(tmp_path, "/turtle2/pose", lambda pose: pose["x"] > 2.5 and pose["y"] == 3.0)
            becomes(tmp_path, "/turtle3/pose", lambda pose: pose["y"] > 3.5)
            becomes(tmp_path, "robot.pose", lambda pose: pose["x"] > 5.6)
            at_goal = becomes(
                tmp_path, "turtle4.pose", lambda pose: pose["x"] < 6.1 and pose["linear"] == 0.0
            )
            assert at_goal["y"] == pytest.approx(9.0, abs=0.05)
            refused = people[0].request(
                "publish", topic="/turtle11/cmd_vel", message={"linear": 1.0, "angular": 0.0}
            )
            assert not refused["ok"]  # it must not drive another one
            done(tmp_path, "stop")
            for topic in ("turtle2.pose", "turtle3.pose"):
                becomes(tmp_path, topic, lambda pose: pose["linear"] == 0.0)
        done(tmp_path, "resume")
        process.send_signal(signal.SIGINT)
        process.wait(REPLY_TIMEOUT_S)
    code, output, complaint = cli(tmp_path, "replay", str(recording), "--check")
    assert code == 0 and "bit for bit" in output, complaint


def test_a_turtle_that_is_not_there_is_named(tmp_path):
    twist = '{"linear": 1.0, "angular": 0.0}'
    with running(tmp_path, "turtles", sets=()):
        code, _, complaint = cli(tmp_path, "topic", "pub", "/turtle2/cmd_vel", twist)
        assert code == 1 and "there is no turtle 2 on the canvas" in complaint
        assert done(tmp_path, "call", "canvas.spawn", "x=2", "y=3", "name=ada").endswith(" ada\n")
        done(tmp_path, "topic", "pub", "/ada/cmd_vel", twist)
        becomes(tmp_path, "/ada/pose", lambda pose: pose["x"] > 2.0 and pose["number"] == 10)
        done(tmp_path, "call", "canvas.kill", "name=ada")
        words = ("topic", "echo", "turtle10.pose", "--for", "0.2s")
        code, output, complaint = cli(tmp_path, *words)
        assert (code, output) == (0, "") and "there is no turtle 10 on the canvas" in complaint
        described = PlainClient(tmp_path).request("describe_topic", topic="turtle10.pose")
        assert described["last"] is None
        assert "no topic '/ada/pose'" in cli(tmp_path, "topic", "echo", "/ada/pose", "--once")[2]
        _, output, complaint = cli(tmp_path, "topic", "echo", "operator.goal", "--for", "0.2s")
        assert output == "" and "no message has come on operator.goal yet" in complaint


def test_the_names_of_turtlesim_are_known(folder):
    code, output, complaint = cli(folder, "topic", "echo", "/turtle1/pose", "--once", "--json")
    assert code == 0, complaint
    assert set(json.loads(output)) >= {"x", "y", "heading"}
    assert "/turtle1/pose is robot.pose here" in complaint
