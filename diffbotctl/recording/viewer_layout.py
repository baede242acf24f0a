"""A layout for Foxglove and Lichtblick: the 3D panel, plots and log of one run.

The format is the one of their menus "Export layout" and "Import from file": panels by identifier,
and a tree that splits the window.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diffbotctl.messages import Odometry, Wheels
from diffbotctl.model.frames import BASE, WORLD

SCENE, SPEED, WHEELS, LOG = "3D!scene", "Plot!speed", "Plot!wheels", "RosOut!log"
TELEOP = "Teleop!velocity"
RUN_LOG = "log.lines"  # the lines of all blocks; another log has those of one
GRID_M = 10.0
CAMERA = {"perspective": True, "distance": 3.0, "phi": 45.0, "thetaOffset": 90.0}
DRAWN = ("FrameTransform", "LaserScan", "SceneUpdate", "Grid")  # pose arrows would hide the robot

Fields = dict[str, Any]


def viewer_layout(
    wires: Mapping[str, type], topics: Mapping[str, str], commands: Mapping[str, str] | None = None
) -> Fields:
    """The layout for a run with these wires, and these topics for viewers with their schemas.

    `commands` maps `goal` and `velocity` to the topics on which a viewer may publish them. Empty
    where there is nothing to draw.
    """
    commands = commands or {}
    panels: dict[str, Fields] = {}
    if "FrameTransform" in topics.values():  # without frames nothing is drawn
        panels[SCENE] = _scene(topics, commands.get("goal"))
    odometry = next((wire for wire, kind in wires.items() if kind is Odometry), None)
    if odometry is not None:
        panels[SPEED] = _plot(
            "Speed, m/s and rad/s", [f'"{odometry}".{field}' for field in ("linear", "angular")]
        )
    wheels = next((wire for wire, kind in wires.items() if kind is Wheels), None)
    if wheels is not None:
        panels[WHEELS] = _plot(
            "Wheels, rad/s", [f'"{wheels}".{field}' for field in ("left", "right")]
        )
    logs = [topic for topic, kind in topics.items() if kind == "Log"]
    if logs:
        lines = RUN_LOG if RUN_LOG in logs else logs[0]
        panels[LOG] = {"topicToRender": lines, "minLogLevel": 1, "searchTerms": []}
    if "velocity" in commands:
        panels[TELEOP] = _teleop(commands["velocity"])
    if SCENE not in panels:
        return {}
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split(list(panels)),
    }


def _split(panels: list[str]) -> Fields | str:
    """The first panel on the left, the others on the right, one above the other."""
    first, *others = panels
    if not others:
        return first
    right: Fields | str = others[-1]
    for count, panel in enumerate(reversed(others[:-1]), 2):
        share = 100 / count
        right = {"direction": "column", "first": panel, "second": right, "splitPercentage": share}
    return {"direction": "row", "first": first, "second": right, "splitPercentage": 65}


def _scene(topics: Mapping[str, str], goal_topic: str | None) -> Fields:
    return {
        "cameraState": CAMERA,
        "followMode": "follow-none",
        "followTf": WORLD if "tf" in topics else BASE,
        "scene": {"transforms": {"showLabel": False, "axisScale": 0.3}},
        "transforms": {},
        "topics": {topic: {"visible": kind in DRAWN} for topic, kind in topics.items()},
        "layers": {
            "grid": {
                "layerId": "foxglove.Grid",
                "instanceId": "grid",
                "label": "Grid",
                "visible": True,
                "frameLocked": True,
                "size": GRID_M,
                "divisions": 10,
            }
        },
        "publish": {"type": "pose", "poseTopic": goal_topic or "goal_pose"},
    }


def _plot(title: str, paths: list[str]) -> Fields:
    series = [{"value": path, "enabled": True, "timestampMethod": "receiveTime"} for path in paths]
    return {
        "title": title,
        "paths": series,
        "showLegend": True,
        "legendDisplay": "floating",
        "isSynced": True,
        "xAxisVal": "timestamp",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
    }


def _teleop(topic: str) -> Fields:
    """Buttons for 0.1 m/s and 0.5 rad/s; one that is held publishes ten times a second."""
    return {
        "topic": topic,
        "publishRate": 10,
        "upButton": {"field": "linear-x", "value": 0.1},
        "downButton": {"field": "linear-x", "value": -0.1},
        "leftButton": {"field": "angular-z", "value": 0.5},
        "rightButton": {"field": "angular-z", "value": -0.5},
    }
