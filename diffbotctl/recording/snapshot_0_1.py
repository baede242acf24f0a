"""States that version 0.1 saved: the present classes and attributes."""

from __future__ import annotations

from math import exp, inf, pi
from types import SimpleNamespace
from typing import Any

from diffbotctl.blocks.goal_follower import GoalFollower
from diffbotctl.blocks.obstacle_stop import ObstacleStop
from diffbotctl.control.goal_pursuit import Coast, Pursuit
from diffbotctl.control.speed_loop import (
    SpeedGains,
    SpeedLoopMirror,
    default_gains,
)
from diffbotctl.estimation.edge_faults import NO_FAULTS
from diffbotctl.estimation.edge_intervals import EdgeIntervals
from diffbotctl.estimation.fine_wheel import FineWheelOdometer
from diffbotctl.estimation.pose_filter import NO_EFFECTS, PoseFilter
from diffbotctl.estimation.pose_history import PoseHistory
from diffbotctl.estimation.predicted_wheel import STARTING_EDGES, MotorKind
from diffbotctl.estimation.wheel_odometer import WheelOdometer
from diffbotctl.estimation.wheel_side import LinkTiming
from diffbotctl.geometry.distance_sensors import SHARPS

# (module, class) then and now.
CLASSES = {
    ("blocks.footprint", "Footprint"): ("geometry.footprint", "Footprint"),
    ("blocks.footprint", "Track"): ("geometry.footprint", "PointTracker"),
    ("blocks.frame_times", "FrameTimes"): ("estimation.timestamp_filter", "TimestampFilter"),
    ("blocks.known_slots", "Flanks"): ("estimation.slot_errors", "EdgeErrors"),
    ("blocks.known_slots", "KnownSlots"): ("estimation.slot_errors", "KnownSlotErrors"),
    ("blocks.disc_search", "DiscSearch"): ("estimation.disc_alignment", "DiscAlignment"),
    ("blocks.loop_mirror", "LoopMirror"): ("control.speed_loop", "SpeedLoopMirror"),
    ("blocks.odometry_wheel", "CountedWheel"): ("estimation.wheel_odometer", "CountWheelOdometer"),
    ("blocks.odometry_wheel", "OdometryWheel"): ("estimation.wheel_odometer", "WheelOdometer"),
    ("blocks.pose_estimate", "PoseEstimate"): ("estimation.pose_filter", "PoseFilter"),
    ("blocks.range_sensor", "Fold"): ("blocks.range_sensor", "FoldbackDetector"),
    ("blocks.rest_to_rest", "Limits"): ("control.motion_profile", "MotionLimits"),
    ("blocks.slot_places", "SlotPlaces"): ("estimation.slot_errors", "SlotErrors"),
    ("blocks.slot_places", "Told"): ("estimation.slot_errors", "SlotEstimate"),
    ("blocks.transition", "Transition"): ("estimation.slot_errors", "Transition"),
    ("blocks.wheel_filter", "WheelFilter"): ("estimation.wheel_filter", "WheelFilter"),
    ("blocks.wheel_motion", "Spread"): ("estimation.priors", "Priors"),
    ("blocks.wheel_motion", "WheelMotion"): ("estimation.wheel_kalman", "WheelKalman"),
    ("blocks.wheel_track", "WheelTrack"): ("estimation.edge_hypothesis", "EdgeHypothesis"),
    **{
        ("config.robot", name): ("config.robot", f"{name}Section")
        for name in ("Curve", "Encoder", "Motor", "Mount", "Sensor", "Side", "SpeedLoop", "Wheel")
    },
}

# By the class's present name: attribute then and now, None where it is no more.
ATTRIBUTES: dict[str, dict[str, str | None]] = {
    "TimestampFilter": {"scatter": "jitter", "seen": "frames"},
    "EdgeErrors": {
        "beyond": "open_share",
        "beyond_variance": "backward_variance",
        "variance": "forward_variance",
    },
    "KnownSlotErrors": {"flanks": "edges", "first": "first_slot", "waiting": None},
    "DiscAlignment": {"tracks": "hypotheses"},
    "WheelOdometer": {
        "begun": "start_correction",
        "first": "first_count",
        "gone": "reported_travel",
        "rolled": "travel",
        "started": "reported_start",
        "to_pitches": "pitches_per_rad",
    },
    "PoseFilter": {
        "first_x": "start_x",
        "first_y": "start_y",
        "first_heading": "start_heading",
        "slipped": "slip_covariance",
    },
    "SlotErrors": {
        "back": "backward_errors",
        "back_variance": "backward_variance",
        "begun": "is_started",
        "both": "learns_backward",
        "error": "errors",
        "learnt": "is_fixed",
        "own": "covariance",
        "shared": "cross_covariance",
        "tolerance": "slot_variance",
        "waiting": "pending",
    },
    "Transition": {"factors": "rows", "still": "is_identity"},
    "WheelFilter": {"flanks": "known_edges", "search": "alignment", "tracks": "hypotheses"},
    "WheelKalman": {
        "ahead": "is_last_forward",
        "dry": "is_dry",
        "evidence": "log_likelihood",
        "shifted": "z_shift",
        "spread": "priors",
    },
    "EdgeHypothesis": {
        "heading": "drive_direction",
        "passed": "edge_direction",
        "slot": "edge_slot",
        "turned_back": "is_reversed",
    },
    "SpeedLoopMirror": {
        "before": None,
        "duty": None,
        "gathered": "integral",
        "last": None,
        "loop": None,
        "slope": None,
    },
    "Gate": {"held": "active_stop", "heard": "telemetry_time", "seen": "last_messages"},
    "GoalFollower": {"left_slots": "left_counts", "right_slots": "right_counts"}
    | dict.fromkeys(
        (
            "allowed",
            "backwards",
            "clock",
            "halting",
            "held",
            "idle",
            "let_go",
            "line",
            "nudge",
            "phase",
            "pivot",
            "roll",
            "seen",
            "still_since",
            "target",
            "time",
            "tries",
            "turning",
        )
    ),
    "FoldbackDetector": {
        "inside": "last_inside",
        "last": "last_time",
        "near": "near_volts",
        "over_peak": "peak_time",
        "to_contact": "contact_time",
    },
    "RangeSensor": {
        "consent": "last_resume",
        "fold": "foldback",
        "since": "volts_since",
        "state": "last_state",
        "zeros": "zero_readings",
    },
    "ScanStop": {
        "answered": "last_twist",
        "held": "reported_code",
        "taken": "last_scan",
        "way": "tracker",
    },
    "Wander": {"last": "last_time", "taken": "last_scan", "turned": "turned_angle"},
    "TurtleCanvas": {"told": "last_sent"},
    "PathSource": {"is_wanted": "is_due"},
    "ObstacleStop": {
        "blocked": "blocked_readings",
        "consent": "last_resume",
        "free": "free_readings",
        "held": None,
        "last_range": "last_range_time",
        "react_within": None,
        "setback": "sensor_setback",
        "told": "reported_code",
    },
    "OdometryBlock": {"times": "timestamps"},
    "WheelSpeed": {"rated": None, "slots": None, "static": None, "sums": "integrals"},
}
ATTRIBUTES["CountWheelOdometer"] = ATTRIBUTES["WheelOdometer"]


# What later versions added to the states of their classes, with its value in a state of 0.1.
ADDED: dict[str, dict[str, Any]] = {
    "FoldbackDetector": {"fold": SHARPS["sharp_gp2y0a41sk0f"].fold},
    "RangeSensor": {"reach": SHARPS["sharp_gp2y0a41sk0f"].reach},
    "EdgeHypothesis": {
        "faults": NO_FAULTS,
        "unseen_edges": 0,
        "duty": 0.0,
        "is_timed": False,
        "coasting_speed": inf,
        "is_placed": False,
        "turning_level": None,
    },
    "WheelKalman": {
        "kind": MotorKind.LINEAR,
        "is_typical": True,
        "is_free_wheeling": False,
        "is_driven": True,
        "driven_noise": 1.0,
        "coasting_noise": 1.0,
        "elapsed": 0.0,
        "held_time": 0.0,
        "edges_since_rest": STARTING_EDGES,
    },
    "TurtleCanvas": {"placements": ()},
    "PoseFilter": {"geometry": (), "unit_effects": NO_EFFECTS},
    "WheelOdometer": {
        "variance": 0.0,
        "added_variance": 0.0,
        "end_variance": 0.0,
        "disagreement": 0.0,
        "fault_share": 0.0,
        "late_corrections": [],
        "disagreement_frames": 0,
        "skipped": None,
        "shares_mirror": False,
        "mirrored_duty": None,
        "has_levels": False,
        "has_counted_level": None,
        "reported_reversals": 0,
    },
}


def reader_class(kind: type) -> type:
    """The class to create an object of `kind` from a state of version 0.1: it takes the attributes
    under their former names, and is then a plain `kind`."""

    def set_state(self: Any, state: Any) -> None:
        self.__class__ = kind
        # An object's state is its dict, or with slots a pair of a dict and the slots' dict.
        parts = state if isinstance(state, tuple) else (state,)
        attributes = {name: value for part in parts for name, value in (part or {}).items()}
        for name, value in present_attributes(kind, attributes).items():
            setattr(self, name, value)

    return type(kind.__name__, (kind,), {"__slots__": (), "__setstate__": set_state})


def present_attributes(kind: type, attributes: dict[str, Any]) -> dict[str, Any]:
    """The attributes of an object of `kind` that version 0.1 saved, by their present names."""
    names = ATTRIBUTES.get(kind.__name__, {})
    renamed = {names.get(name, name): value for name, value in attributes.items()}
    present = {name: value for name, value in renamed.items() if name is not None}
    present.update(ADDED.get(kind.__name__, {}))
    if kind is PoseFilter:
        present["history"] = PoseHistory()
    if kind.__name__ == "EdgeHypothesis":
        present["travels"] = []
    if issubclass(kind, WheelOdometer):
        present["reported_hypothesis"] = present["filter"].hypotheses[0]
        present["reported_pushed"] = 0
        present["intervals"] = EdgeIntervals()
        present["counting"] = _counting(present)
    if kind is GoalFollower:
        return {**present, **_goal_follower(attributes)}
    if kind is ObstacleStop:
        present["code"], present["cause"] = attributes["held"]
    if kind is SpeedLoopMirror:
        return _speed_loop_mirror(attributes["loop"], attributes["slope"], present)
    return present


def _counting(present: dict[str, Any]) -> FineWheelOdometer:
    """Counts beside the model of a wheel, which begin at this state."""
    hypothesis = present["filter"].hypotheses[0]
    motor = SimpleNamespace(
        rated=present["rated"],
        lag=exp(hypothesis.motion.log_lag),
        loop=SimpleNamespace(static=present["static"]),
    )
    slots = round(2.0 * pi * present["pitches_per_rad"])
    side: Any = SimpleNamespace(
        motor=motor,
        wheel=SimpleNamespace(diameter=present["pitch"] * slots / pi),
        encoder=SimpleNamespace(counts=slots, slots=slots),
    )
    timing = LinkTiming(0.0, 0.0, hypothesis.motion.priors.has_edge_times)
    counting = FineWheelOdometer(side, hypothesis.time, present["count"], timing, finds_steps=False)
    counting.position = hypothesis.motion.travel
    return counting


def _speed_loop_mirror(loop: Any, slope: float, present: dict[str, Any]) -> dict[str, Any]:
    """The state of a mirror, whose measurement of the speed begins anew."""
    gains = SpeedGains(loop.static, slope, *default_gains(slope))
    mirror = SpeedLoopMirror(gains, 1, present["time"])
    # Not by `__slots__`, which a compiled class does not have.
    values = {name: getattr(mirror, name) for name in dir(mirror) if not name.startswith("__")}
    state = {name: value for name, value in values.items() if not callable(value)}
    return {**state, **present}


def _goal_follower(old: dict[str, Any]) -> dict[str, Any]:
    """The state of the block `goal_follower`, which was one attribute each."""
    coast = Coast(old["roll"], old["let_go"], old["turning"])
    pursuit = None
    if old["target"] is not None:
        pursuit = Pursuit(
            goal=old["target"],
            time_limit=old["allowed"],
            coast=coast,
            leg=old["phase"],
            line=old["line"],
            is_backwards=old["backwards"],
            pivot=old["pivot"],
            is_coasting=old["halting"],
            still_since=old["still_since"],
            needs_nudge=old["nudge"],
            attempts=old["tries"],
            elapsed=old["clock"],
            blocked_for=old["held"],
            idle_for=old["idle"],
        )
    return {"coast": coast, "last_goal": old["seen"], "pursuit": pursuit}
