"""`diffbotctl foxglove` against a viewer written from the protocol, and a real run."""

import asyncio
import base64
import json
import os
import signal
import socket
from pathlib import Path

import aiohttp
import pytest
from jsonschema import Draft7Validator

from tests.support.foxglove_viewer import TIMEOUT_S, FoxgloveViewer, serving_viewers, twist
from tests.support.running import PlainClient, cli, moves, running, stands

SENSED = "range.range.scan"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foxglove")
    with running(folder, "standby", "--stay"):
        yield folder


@pytest.fixture(scope="module")
def server(folder):
    with serving_viewers(folder, "--allow", "goal,velocity") as server:
        yield server


@pytest.fixture
def engine(folder):
    client = PlainClient(folder)
    yield client
    client.close()


def viewed(server, work, **options):
    """Run `work(viewer)` with a viewer that has been greeted."""

    async def run():
        async with (
            asyncio.timeout(TIMEOUT_S),
            FoxgloveViewer(server.address, **options) as viewer,
        ):
            await viewer.greeted()
            return await work(viewer)

    return asyncio.run(run())


ROAM = """
format: 1
kind: pipeline
include: map
blocks:
  wander: {block: wander, in: {scan: robot.scan, odometry: odometry.odometry}}
  mux: {in: {autonomous: wander.twist}}
sources:
  map: {with: {autosave: false}}
"""


def test_a_viewer_sees_the_map_grow_while_the_robot_drives(tmp_path):
    (tmp_path / "roam.yaml").write_text(ROAM)

    async def work(viewer):
        await viewer.subscribe("map.update.grid", "tf")
        validator = Draft7Validator(json.loads(viewer.channels["map.update.grid"]["schema"]))
        walls, edges = [], set()
        while len(walls) < 2 or walls[-1] < walls[0] + 100 or ("map", "odom") not in edges:
            frame = await viewer.until(lambda frame: "topic" in frame)
            message = frame["message"]
            if frame["topic"] == "tf":
                edges.add((message["parent_frame_id"], message["child_frame_id"]))
                continue
            validator.validate(message)
            cells = base64.b64decode(message["data"])
            assert len(cells) % message["column_count"] == 0 and message["frame_id"] == "map"
            walls.append(cells.count(255))
        assert walls[0] > 50

    with (
        running(tmp_path, str(tmp_path / "roam.yaml"), sets=()),
        serving_viewers(tmp_path) as server,
    ):
        viewed(server, work)


@pytest.mark.parametrize("subprotocol", ["foxglove.sdk.v1", "foxglove.websocket.v1"])
def test_a_viewer_sees_topics_frames_scene_scan_and_log(server, subprotocol):
    async def work(viewer):
        assert viewer.socket.protocol == subprotocol
        (info,) = (frame for frame in viewer.frames if frame["op"] == "serverInfo")
        assert {"clientPublish", "parameters", "services", "connectionGraph"} <= set(
            info["capabilities"]
        )
        assert info["supportedEncodings"] == ["json"]
        topics = ["odometry.odometry", "tf", "robot", "trail", SENSED, "log.lines"]
        await viewer.subscribe(*topics)
        seen = {}
        while set(topics) - set(seen):
            frame = await viewer.until(lambda frame: "topic" in frame)
            seen[frame["topic"]] = frame["message"]
            row = viewer.channels[frame["topic"]]
            assert row["schemaEncoding"] == "jsonschema"
            if row["schemaName"].startswith("foxglove."):
                Draft7Validator(json.loads(row["schema"])).validate(frame["message"])
        assert {"base_link", "left_wheel_link"} <= {
            each["id"] for each in seen["robot"]["entities"]
        }
        assert seen[SENSED]["frame_id"] == "front_sensor_link"
        await viewer.operate("unsubscribe", subscriptionIds=list(viewer.subscribed))

    viewed(server, work, subprotocol=subprotocol)


def test_frames_of_the_robot_come_with_the_subscription(server):
    async def work(viewer):
        await viewer.subscribe("tf")
        links = set()
        while not {"base_footprint", "base_link", "front_sensor_link"} <= links:
            frame = await viewer.data("tf")
            links.add(frame.message["child_frame_id"])

    viewed(server, work)


def test_parameters_are_read_set_and_followed(server, engine):
    async def work(viewer):
        await viewer.operate("getParameters", parameterNames=[], id="all")
        reply = await viewer.until(lambda frame: frame.get("id") == "all")
        values = {row["name"]: row["value"] for row in reply["parameters"]}
        assert values["guard.margin"] > 0
        await viewer.operate("subscribeParameterUpdates", parameterNames=["guard.margin"])
        expected = {"name": "guard.margin", "value": 0.07}
        await viewer.operate("setParameters", parameters=[expected], id="set")
        reply = await viewer.until(lambda frame: frame.get("op") == "parameterValues")
        assert [(row["name"], row["type"]) for row in reply["parameters"]] == [
            ("guard.margin", "float64")
        ]
        await viewer.operate("setParameters", parameters=[{"name": "odometry.nothing", "value": 1}])
        refused = await viewer.until(lambda frame: frame.get("op") == "status")
        assert refused["level"] == 2 and "nothing" in refused["message"]
        rows = [{"name": "guard.margin", "value": float("nan")}]
        await viewer.operate("setParameters", parameters=rows)
        refused = await viewer.until(lambda frame: frame.get("op") == "status")
        assert refused["level"] == 2

    viewed(server, work)
    rows = engine.request("list_parameters")["parameters"]
    assert {row["parameter"]: row["value"] for row in rows}["guard.margin"] == 0.07


def test_what_another_client_sets_is_sent_to_viewers(server, engine):
    async def work(viewer):
        await viewer.operate("subscribeParameterUpdates", parameterNames=["guard.margin"])
        reply = engine.request("set_parameter", parameter="guard.margin", value=0.065)
        assert reply["ok"]
        await viewer.until(
            lambda frame: [row["value"] for row in frame.get("parameters", [])] == [0.065]
        )

    viewed(server, work)


def test_the_connection_graph_and_the_files(server):
    async def work(viewer):
        await viewer.operate("subscribeConnectionGraph")
        graph = await viewer.until(lambda frame: frame.get("op") == "connectionGraphUpdate")
        (odometry,) = (t for t in graph["publishedTopics"] if t["name"] == "odometry.odometry")
        assert odometry["publisherIds"] == ["odometry"]
        followers = {t["name"]: t["subscriberIds"] for t in graph["subscribedTopics"]}
        assert "follower" in followers["odometry.odometry"]
        assert {row["name"] for row in graph["advertisedServices"]} == {"stop", "resume"}
        await viewer.operate("fetchAsset", uri="package://diffbotctl/robot.urdf", requestId=1)
        urdf = await viewer.until(lambda frame: frame.get("asset") == 1)
        assert urdf["status"] == 0 and b"<robot" in urdf["data"]
        await viewer.operate("fetchAsset", uri="layout.json", requestId=2)
        layout = await viewer.until(lambda frame: frame.get("asset") == 2)
        panels = json.loads(layout["data"])["configById"]
        assert panels["Teleop!velocity"]["topic"] == "cmd_vel"
        await viewer.operate("fetchAsset", uri="file:///etc/passwd", requestId=3)
        missing = await viewer.until(lambda frame: frame.get("asset") == 3)
        assert missing["status"] == 1 and not missing["data"]

    viewed(server, work)


def has_reached(goal_state):
    return goal_state is not None and goal_state["state"].startswith("reached")


def test_a_goal_is_driven_to_and_drawn(server, engine):
    async def work(viewer):
        await viewer.subscribe("goal")
        await viewer.advertise(1, "/goal_pose", "geometry_msgs/PoseStamped")
        place = {"x": 0.2, "y": 0.1, "z": 0.0}
        pose = {"position": place, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
        await viewer.publish(1, {"header": {"frame_id": "odom"}, "pose": pose})
        drawn = await viewer.data(
            "goal",
            lambda m: (
                m["entities"] and m["entities"][0]["cylinders"][0]["pose"]["position"]["x"] == 0.2
            ),
        )
        assert drawn.message["entities"][0]["arrows"]

    viewed(server, work)
    reached = engine.until(
        lambda status: (status["goal_state"] or {}).get("state", "").startswith("reached")
    )
    assert (reached["operator.goal"]["x"], reached["operator.goal"]["y"]) == (0.2, 0.1)


def is_driven(engine, start):
    """Whether a velocity was commanded after the logical time `start`."""
    last = engine.request("describe_topic", topic="operator.twist")["last"]
    return last is not None and last["time"] > start and last["linear"] > 0.0


async def drive(viewer, engine):
    """Publish a velocity until the wheels turn. On a busy machine the viewer may be late: again."""
    start = engine.request("status")["time"]
    await viewer.advertise(7, "/cmd_vel", "geometry_msgs/Twist")
    while True:
        await viewer.publish(7, twist(0.1))
        await asyncio.sleep(0.05)
        status = engine.request("status")
        if status["held"] is not None:
            await viewer.publish(7, twist(0.0))
            engine.request("resume")
        elif moves(status) and is_driven(engine, start):
            return


def lost_by(status, name):
    held = status["held"]
    return held is not None and held["code"] == "operator_lost" and name in held["cause"]


def test_a_viewer_drives_and_its_zero_releases(server, engine):
    async def work(viewer):
        while True:
            await drive(viewer, engine)
            await viewer.publish(7, twist(0.0))
            if engine.until(stands)["held"] is None:
                return

    viewed(server, work)


def test_a_silent_viewer_stops_the_robot_and_the_service_resumes(server, engine):
    async def work(viewer):
        await drive(viewer, engine)
        status = engine.until(lambda status: lost_by(status, "viewer"))
        assert status["held"]["latched"]
        await viewer.publish(7, twist(0.1))  # latched: it does not move
        assert await viewer.call("resume", 3) == {"success": True, "message": ""}
        engine.until(lambda status: status["held"] is None and stands(status))

    viewed(server, work)


def test_a_viewer_that_disconnects_while_it_drives_stops_the_robot(server, engine):
    viewed(server, lambda viewer: drive(viewer, engine))
    engine.until(lambda status: lost_by(status, "viewer"))
    assert engine.request("resume")["ok"]
    engine.until(lambda status: status["held"] is None)


def test_the_service_stop(server, engine):
    async def work(viewer):
        assert (await viewer.call("stop", 1))["success"]

    viewed(server, work)
    held = engine.until(lambda status: status["held"] is not None)["held"]
    assert "service stop of viewer" in held["cause"]
    assert engine.request("resume")["ok"]


def test_nonsense_is_refused_in_words_and_the_viewer_goes_on(server):
    async def work(viewer):
        for frame in ("nonsense", "[]", '{"op": "dance"}', '{"op": "subscribe"}'):
            await viewer.socket.send_str(frame)
            assert (await viewer.until(lambda frame: frame.get("op") == "status"))["level"] == 2
        for data in (b"\xff", b"\x01\x00\x00\x00\x00{}"):
            await viewer.socket.send_bytes(data)
            assert (await viewer.until(lambda frame: frame.get("op") == "status"))["level"] == 2
        await viewer.advertise(1, "/cmd_vel_2", "geometry_msgs/Twist")
        refused = await viewer.until(lambda frame: frame.get("op") == "status")
        assert "no topic for viewers" in refused["message"]
        await viewer.subscribe("odometry.odometry")
        await viewer.data("odometry.odometry")

    viewed(server, work)


def test_a_frame_that_is_too_big_ends_the_connection(server):
    async def work(viewer):
        await viewer.socket.send_str("x" * (1 << 20))
        with pytest.raises((ConnectionError, aiohttp.ClientError)):
            await viewer.until(lambda frame: False)

    viewed(server, work)


def refused_status(address, **headers):
    """The HTTP status with which a connection is refused."""

    async def run():
        async with aiohttp.ClientSession() as session:
            try:
                async with session.ws_connect(
                    address, protocols=["foxglove.sdk.v1"], headers=headers
                ):
                    return 101
            except aiohttp.WSServerHandshakeError as error:
                return error.status

    return asyncio.run(run())


@pytest.mark.parametrize(
    "path, headers, status",
    [
        ("", {}, 401),
        ("guessed", {}, 401),
        (None, {"Origin": "https://evil.example"}, 403),
        (None, {"Origin": "null"}, 403),
        (None, {"Origin": ""}, 403),
        (None, {"Host": "evil.example"}, 421),
        (None, {"Host": "evil.example:8765"}, 421),
        (None, {"Origin": "https://app.foxglove.dev"}, 101),
        (None, {}, 101),
    ],
)
def test_only_who_has_token_origin_and_host_gets_in(server, path, headers, status):
    address = server.address
    if path is not None:
        address = f"ws://127.0.0.1:{server.port}/{path}"
    assert refused_status(address, **headers) == status


def test_it_listens_on_the_loopback_address_only(server):
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A"]
    assert [each for each in listening if each.endswith(f":{server.port:04X}")] == [
        f"0100007F:{server.port:04X}"
    ]


def test_without_allow_nothing_can_be_published_set_or_resumed(folder, engine):
    async def work(viewer):
        (info,) = (frame for frame in viewer.frames if frame["op"] == "serverInfo")
        assert "clientPublish" not in info["capabilities"]
        assert set(viewer.services) == {"stop"}
        for number, topic in enumerate(("/cmd_vel", "/goal_pose")):
            await viewer.advertise(number, topic, "geometry_msgs/Twist")
            refused = await viewer.until(lambda frame: frame.get("op") == "status")
            assert "--allow" in refused["message"]
            await viewer.publish(number, twist(0.1))
            refused = await viewer.until(lambda frame: frame.get("op") == "status")
            assert "was not advertised" in refused["message"]
        await viewer.operate("setParameters", parameters=[{"name": "guard.margin", "value": 0.3}])
        refused = await viewer.until(lambda frame: frame.get("op") == "status")
        assert "may not set" in refused["message"]
        assert stands(engine.request("status"))

    with serving_viewers(folder) as server:
        viewed(server, work)


def test_a_server_that_is_killed_while_a_viewer_drives_stops_the_robot(folder, engine):
    with serving_viewers(folder, "--allow", "velocity") as server:

        async def work(viewer):
            await drive(viewer, engine)
            os.kill(server.process.pid, signal.SIGKILL)

        viewed(server, work)
        engine.until(lambda status: lost_by(status, "viewer 1"))
    assert engine.request("resume")["ok"]


def test_a_port_that_is_taken_and_a_wrong_word_are_reported(folder):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        code, _, complaint = cli(folder, "foxglove", "--tcp-port", port)
    assert code == 1 and "E-FOXGLOVE-LISTEN" in complaint and "--tcp-port" in complaint
    code, _, complaint = cli(folder, "foxglove", "--allow", "goal,all")
    assert code == 2 and "'all' is none of goal, velocity" in complaint


def test_the_server_ends_with_the_run(tmp_path):
    async def work(viewer):
        run.terminate()
        await viewer.until(lambda frame: "the run has ended" in frame.get("message", ""))

    with running(tmp_path, "standby", "--stay") as run, serving_viewers(tmp_path) as server:
        viewed(server, work)
        assert server.process.wait(TIMEOUT_S) == 0
