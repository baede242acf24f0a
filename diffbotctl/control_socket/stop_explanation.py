"""Why the robot last stopped: the chain of causes from the sensor to the motors, as a paragraph."""

from __future__ import annotations

from math import hypot

from diffbotctl.codes import code_texts
from diffbotctl.control_socket.run_state import RunState, StopEpisode
from diffbotctl.graph import Graph
from diffbotctl.messages import Encoders, Link, Message, Odometry, Range, Stop, Twist, Volts, Wheels
from diffbotctl.time import SECOND

STANDS = 0.005  # m/s and rad/s; slower is between two slots of an encoder
SENSED = (Volts, Range, Encoders, Link)


def explain_stop(known: RunState, graph: Graph) -> str:
    """One paragraph: what held the robot, what was known then, what left, and the way out."""
    if not known.episodes:
        return f"Nothing has stopped the robot in {known.now / SECOND:.1f} s. {_doing(known)}"
    episode = known.episodes[-1]
    sentences = [_first(episode), *_upstream(episode, graph), *_left(episode, known)]
    return " ".join([*sentences, _rest(known), _way_out(episode, known)])


def _first(episode: StopEpisode) -> str:
    name = episode.wire.partition(".")[0]
    code = code_texts().get(episode.stop.code)
    title = f" ({code.title})" if code is not None else ""
    return (
        f"At {episode.time / SECOND:.2f} s {name} stopped the robot: {episode.stop.code}{title}: "
        f"{episode.stop.cause}."
    )


def _upstream(episode: StopEpisode, graph: Graph) -> list[str]:
    """What the sensors upstream of the stop had said, the nearest to the world first."""
    by_name = {node.name: node for node in graph.nodes}
    wires: list[str] = []
    waiting = [episode.wire.partition(".")[0]]
    seen: set[str] = set()
    while waiting:
        node = by_name.get(waiting.pop(0))
        if node is None or node.name in seen:
            continue
        seen.add(node.name)
        wires += [wire for wire in node.wires.values() if wire not in wires]
        if node.name != "gate":  # behind the gate stands the whole pipeline: too long a story
            waiting += [wire.partition(".")[0] for wire in node.wires.values()]
    told = [
        f"{wire} had said {_said(message)} at {message.time / SECOND:.2f} s"
        for wire in reversed(wires)
        if type(message := episode.before.get(wire)) in SENSED and message is not None
    ]
    return [f"Before it {', '.join(told)}."] if told else []


def _left(episode: StopEpisode, known: RunState) -> list[str]:
    wanted = [
        f"{wire} wanted {_said(message)}"
        for wire, message in episode.before.items()
        if isinstance(message, Twist)
        and wire.startswith(("follower.", "mux.", "operator."))
        and episode.time - message.time < SECOND
    ]
    sent = known.latest.get("gate.wheels")
    told = [f"In that moment {', '.join(wanted)}."] if wanted else []
    if isinstance(sent, Wheels):
        told.append(f"What the gate sends to the motors now is {_said(sent)}.")
    return told


def _rest(known: RunState) -> str:
    for message in known.latest.values():
        if isinstance(message, Odometry):
            moving = hypot(message.linear, message.angular) > STANDS
            return "The wheels still turn." if moving else "The wheels stand still."
    return ""


def _way_out(episode: StopEpisode, known: RunState) -> str:
    held = known.holding()
    if held is None:
        return "Nothing holds the robot any more."
    _, stop = held
    also = "" if stop.code == episode.stop.code else f"It is held by {stop.code}: {stop.cause}. "
    if stop.latched:
        return f"{also}It waits for `diffbotctl resume`."
    return f"{also}It goes on by itself when the cause has gone."


def _doing(known: RunState) -> str:
    state = known.goal_state()
    if state is None:
        return "No goal is under way."
    told = f"Goal {state.number} is {state.state.replace('_', ' ')}"
    return f"{told}: {state.cause}." if state.cause else f"{told}."


def _said(message: Message) -> str:
    """The message's heart in a few words."""
    match message:
        case Range():
            return f"{message.state.replace('_', ' ')}, {message.distance:.3f} m"
        case Volts():
            return f"{message.volts:.2f} V"
        case Encoders():
            return f"counts {message.left} and {message.right}"
        case Link():
            return f"{message.state}{f' ({message.cause})' if message.cause else ''}"
        case Twist():
            return f"{message.linear:+.3f} m/s {message.angular:+.2f} rad/s"
        case Wheels():
            return f"{message.left:+.2f} and {message.right:+.2f} rad/s"
        case Stop():
            return f"{message.code or 'nothing'}"
    return str(message)
