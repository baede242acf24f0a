"""The state of all blocks and wires between two instants, as bytes; and back.

A recording may come from anywhere, so reading a state must not be a way to run a program: only the
plain classes of blocks and messages are brought back, nothing that touches a file or a process.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

from diffbotctl.engine.loop import Engine
from diffbotctl.log import Logbook

# Modules whose classes hold nothing but numbers, texts and one another.
PLAIN = (
    "diffbotctl.blocks.",
    "diffbotctl.control.",
    "diffbotctl.estimation.",
    "diffbotctl.geometry.",
    "diffbotctl.messages",
    "diffbotctl.config.robot",
    "diffbotctl.params",
    "diffbotctl.engine.safety_gate",
)
# Where version 0.1 had the classes that its states hold: (module, class) then and now.
VERSION_0_1 = {
    ("blocks.footprint", "Footprint"): ("geometry.footprint", "Footprint"),
    ("blocks.footprint", "Track"): ("geometry.footprint", "PointTracker"),
    ("blocks.frame_times", "FrameTimes"): ("estimation.timestamp_filter", "TimestampFilter"),
    ("blocks.known_slots", "Flanks"): ("estimation.known_slot_errors", "EdgeErrors"),
    ("blocks.known_slots", "KnownSlots"): ("estimation.known_slot_errors", "KnownSlotErrors"),
    ("blocks.disc_search", "DiscSearch"): ("estimation.disc_alignment", "DiscAlignment"),
    ("blocks.loop_mirror", "Loop"): ("control.speed_loop_mirror", "SpeedLoopState"),
    ("blocks.loop_mirror", "LoopMirror"): ("control.speed_loop_mirror", "SpeedLoopMirror"),
    ("blocks.odometry_wheel", "CountedWheel"): (
        "estimation.wheel_odometer",
        "CountWheelOdometer",
    ),
    ("blocks.odometry_wheel", "OdometryWheel"): ("estimation.wheel_odometer", "WheelOdometer"),
    ("blocks.pose_estimate", "PoseEstimate"): ("estimation.pose_filter", "PoseFilter"),
    ("blocks.range_sensor", "Fold"): ("blocks.range_sensor", "FoldbackDetector"),
    ("blocks.rest_to_rest", "Limits"): ("control.motion_profile", "MotionLimits"),
    ("blocks.slot_places", "SlotPlaces"): ("estimation.slot_errors", "SlotErrors"),
    ("blocks.slot_places", "Told"): ("estimation.slot_errors", "SlotEstimate"),
    ("blocks.transition", "Transition"): ("estimation.wheel_transition", "Transition"),
    ("blocks.wheel_filter", "WheelFilter"): ("estimation.wheel_filter", "WheelFilter"),
    ("blocks.wheel_motion", "Spread"): ("estimation.wheel_kalman", "Priors"),
    ("blocks.wheel_motion", "WheelMotion"): ("estimation.wheel_kalman", "WheelKalman"),
    ("blocks.wheel_track", "WheelTrack"): ("estimation.edge_hypothesis", "EdgeHypothesis"),
    **{
        ("config.robot", name): ("config.robot", f"{name}Section")
        for name in ("Curve", "Encoder", "Motor", "Mount", "Sensor", "Side", "SpeedLoop", "Wheel")
    },
}
COLLECTIONS = {("collections", "deque"), ("builtins", "set"), ("builtins", "frozenset")}


class StateError(ValueError):
    """The state cannot be taken or brought back; the text says why."""


def take_snapshot(engine: Engine) -> bytes:
    """The state after the last instant. Raises StateError when a block holds what has no bytes."""
    blocks = {node.name: _own(vars(node.block)) for node in engine.graph.nodes}
    told = None if engine.chronicle is None else engine.chronicle.state()
    try:
        # In one piece: what blocks and wires share stays shared.
        state = (blocks, engine.compiled.state(), _said(engine.graph.book), told)
        return pickle.dumps(state, pickle.HIGHEST_PROTOCOL)
    except Exception as error:  # a block of somebody else's may hold anything
        raise StateError(str(error)) from error


def restore_snapshot(data: bytes, engine: Engine) -> None:
    """Bring back a state taken from an engine with an equal graph.

    Raises StateError when it does not fit.
    """
    try:
        blocks, wires, said, told = _Plain(io.BytesIO(data)).load()
        for node in engine.graph.nodes:
            vars(node.block).update(_own(blocks[node.name]))
        engine.compiled.restore(wires)
        if engine.graph.book is not None and said is not None:
            _say_on(engine.graph.book, *said)
        if engine.chronicle is not None and told is not None:
            engine.chronicle.restore(told)
    except StateError:
        raise
    except Exception as error:  # a damaged state fails in any way
        raise StateError(f"it does not fit this pipeline ({type(error).__name__})") from error


def _own(state: dict[str, Any]) -> dict[str, Any]:
    """What belongs to a block itself: its voice belongs to the book of its graph."""
    return {name: value for name, value in state.items() if name != "log"}


def _said(book: Logbook | None) -> tuple[dict[str, int], dict[str, tuple[int, int]]] | None:
    """Which lines are wanted of each source, and how many it has said; on these the log hangs."""
    if book is None:
        return None
    return {source: log.threshold for source, log in book.logs.items()}, book.said


def _say_on(book: Logbook, thresholds: dict[str, int], said: dict[str, tuple[int, int]]) -> None:
    for source, threshold in thresholds.items():
        book.of(source).set(threshold)
    book.said.update(said)


class _Plain(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in COLLECTIONS:
            return super().find_class(module, name)
        before = (module.removeprefix("diffbotctl."), name)
        if before in VERSION_0_1:
            module, name = VERSION_0_1[before]
            module = f"diffbotctl.{module}"
        if module.startswith(PLAIN):
            found = super().find_class(module, name)
            if isinstance(found, type) and found.__module__ == module:
                return found
        raise StateError(f"it holds a {module}.{name}, which is not brought back")
