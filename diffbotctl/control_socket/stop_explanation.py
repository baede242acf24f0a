"""Why the robot last stopped: the chain of causes from the sensor to the motors, as a paragraph."""

from __future__ import annotations

from math import hypot, inf
from typing import NamedTuple

from diffbotctl.codes import code_texts
from diffbotctl.control_socket.run_state import RunState, StopEpisode
from diffbotctl.estimation.imu_text import imu_text
from diffbotctl.graph import Graph
from diffbotctl.messages import (
    Encoders,
    Imu,
    Link,
    Message,
    Odometry,
    Range,
    Scan,
    Stop,
    Twist,
    Volts,
    Wheels,
)
from diffbotctl.time import SECOND

STANDSTILL_MAX = 0.005  # m/s and rad/s; slower is between two slots of an encoder
MOTION_MAX_AGE_S = 0.5  # of odometry, for a sentence about now; a link is silent for longer
# A lost link first: the stops of silent sensors and of old telemetry follow from it.
LINK_CODES = ("link_lost", "telemetry_stale")
SENSOR_MESSAGES = (Volts, Range, Scan, Encoders, Link)


class StopExplanation(NamedTuple):
    """Why the robot stopped: `summary`, for a person, and `text`, a paragraph with the chain of
    causes from the sensor to the motors."""

    summary: str
    text: str


def explain_stop(state: RunState, graph: Graph, ending: str | None = None) -> StopExplanation:
    """Explain the last stop. `ending`: why the run has ended, of one that has."""
    if not state.stops:
        nothing = f"Nothing has stopped the robot in {state.now / SECOND:.1f} s."
        summary = f"{nothing} {_link(state) or _goal(state)}"
        if ending is not None:
            summary = explain_end(None, ending)
        return StopExplanation(summary, " ".join([summary, *_imu(state)]))
    episode = _explained_stop(state)
    end = _how_it_ends(episode, state) if ending is None else explain_end(None, ending)
    causes = [_stop(episode), *_sensors(episode, graph), *_commands(episode, state)]
    summary = f"{_at(episode.time, episode.stop)} {end}"
    return StopExplanation(summary, " ".join([*causes, _motion(state), *_imu(state), end]))


def explain_end(stop: Stop | None, ending: str) -> str:
    """The last stop of a run that has ended, if there was one, and how the run ended."""
    end = f"The run has ended: {ending}."
    return end if stop is None else f"{_at(stop.time, stop)} {end}"


def _at(time: int, stop: Stop) -> str:
    return f"At {time / SECOND:.2f} s: {_title(stop)}: {stop.cause}."


def _explained_stop(state: RunState) -> StopEpisode:
    """The last stop; of several at the same time the link's, from which others follow."""
    in_force = {stop.code for _, stop in state.stops_in_force()}
    for code in LINK_CODES:
        for episode in reversed(state.standstill):
            if episode.stop.code == code and (not in_force or code in in_force):
                return episode
    return state.stops[-1]


def _stop(episode: StopEpisode) -> str:
    name = episode.wire.rpartition(".")[0]
    return (
        f"At {episode.time / SECOND:.2f} s {name} stopped the robot: {episode.stop.code} "
        f"({_title(episode.stop)}): {episode.stop.cause}."
    )


def _title(stop: Stop) -> str:
    """The meaning of the stop's code; that of another package is its own."""
    code = code_texts().get(stop.code)
    return stop.code if code is None else code.title


def _sensors(episode: StopEpisode, graph: Graph) -> list[str]:
    """The newest sensor messages upstream of the stop, the farthest upstream first."""
    by_name = {node.name: node for node in graph.nodes}
    wires: list[str] = []
    waiting = [episode.wire.rpartition(".")[0]]
    visited: set[str] = set()
    while waiting:
        node = by_name.get(waiting.pop(0))
        if node is None or node.name in visited:
            continue
        visited.add(node.name)
        wires += [wire for wire in node.wires.values() if wire not in wires]
        if node.name != "gate":  # the whole pipeline is upstream of the gate
            waiting += [wire.rpartition(".")[0] for wire in node.wires.values()]
    texts = [
        f"{wire}: {_summary(message)} ({message.time / SECOND:.2f} s)"
        for wire in reversed(wires)
        if isinstance(message := episode.before.get(wire), SENSOR_MESSAGES)
    ]
    return [f"Before it, {'; '.join(texts)}."] if texts else []


def _commands(episode: StopEpisode, state: RunState) -> list[str]:
    velocities = [
        f"{wire} commanded {_summary(message)}"
        for wire, message in episode.before.items()
        if isinstance(message, Twist)
        and wire.startswith(("follower.", "mux.", "operator."))
        and episode.time - message.time < SECOND
    ]
    sentences = [f"At that time {', '.join(velocities)}."] if velocities else []
    sent = state.newest.get("gate.wheels")
    if isinstance(sent, Wheels):
        sentences.append(f"The gate now sends {_summary(sent)} to the motors.")
    return sentences


def _motion(state: RunState) -> str:
    for wire, message in state.newest.items():
        if isinstance(message, Odometry):
            age = state.age(wire)
            if age is not None and age > MOTION_MAX_AGE_S:
                return f"Of the wheels nothing is known: the last odometry is {age:.1f} s old."
            is_moving = hypot(message.linear, message.angular) > STANDSTILL_MAX
            return "The wheels are still turning." if is_moving else "The wheels are at rest."
    return ""


def _imu(state: RunState) -> list[str]:
    imus = [message for message in state.newest.values() if isinstance(message, Imu)]
    return [f"IMU: {imu_text(max(imus, key=lambda imu: imu.time))}."] if imus else []


def _link(state: RunState) -> str:
    """Why nothing can move, where the link to a board is not up."""
    for message in state.newest.values():
        if isinstance(message, Link) and message.state != "up":
            cause = f": {message.cause}" if message.cause else ""
            return f"The link to the board is not up ({message.state}){cause}."
    return ""


def _how_it_ends(episode: StopEpisode, state: RunState) -> str:
    in_force = state.stop_in_force()
    if in_force is None:
        return "The robot may move again."
    _, stop = in_force
    other = (
        "" if stop.code == episode.stop.code else f"It is stopped by {stop.code}: {stop.cause}. "
    )
    if stop.latched:
        return f"{other}It waits for `diffbotctl resume`."
    return f"{other}It continues by itself when the cause ends."


def _goal(state: RunState) -> str:
    goal = state.goal_state()
    if goal is None:
        return "No goal is under way."
    cause = f": {goal.cause}" if goal.cause else ""
    return f"Goal {goal.number} is {goal.state.replace('_', ' ')}{cause}."


def _summary(message: Message) -> str:
    match message:
        case Range():
            return f"{message.state.replace('_', ' ')}, {message.distance:.3f} m"
        case Scan():
            measured = [far for far in message.distances if 0.0 < far < inf]
            nearest = f", the nearest {min(measured):.2f} m" if measured else ""
            return f"{len(measured)} of {len(message.distances)} rays with a distance{nearest}"
        case Volts():
            return f"{message.volts:.2f} V"
        case Encoders():
            return f"counts left {message.left}, right {message.right}"
        case Link():
            return f"{message.state}{f' ({message.cause})' if message.cause else ''}"
        case Twist():
            return f"{message.linear:+.3f} m/s {message.angular:+.2f} rad/s"
        case Wheels():
            return f"{message.left:+.2f} and {message.right:+.2f} rad/s"
        case Stop():
            return f"{message.code or 'nothing'}"
    return str(message)
