"""Measure every section and print each figure beside its target.

Rows are compared with those of the last time on this machine; the last lines name what changed.
"""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from prove import (
    chain,
    dashboard,
    extending,
    far_operator,
    faults,
    firmware,
    first_goal,
    hostile,
    imu,
    kit_sensors,
    matrix,
    motion,
    mutations,
    operator_load,
    operator_people,
    page,
    plants,
    pulses,
    recordings,
    ros2,
    ros2_chain,
    several_robots,
    viewers,
)
from tests.support.trials import (
    calibrated_values,
    calibration,
    child_faults,
    dashboard_hours,
    flash,
    foreign_logs,
    from_log,
    host_freeze,
    map_flats,
    map_places,
    map_runs,
    maps,
    page_losses,
    radio,
    restarts,
    rosserial,
    runaway,
    same_end,
    wander,
    wheel_loop,
)
from tests.support.trials.proof import arguments, prove
from tests.support.trials.row import Row
from tests.support.trials.section import Section

# The sizes in full are such that a section takes 20 minutes at most on two idle cores.
SECTIONS = (
    Section("motion", motion.rows, {"robots": 300}, {"robots": 1}, True),
    Section("plants", plants.rows, {"goals": 50}, {"goals": 1, "plants": 1}, True),
    Section("smooth", pulses.smooth_rows, {"goals": 60}, {"goals": 1}, True),
    Section("short-goals", pulses.short_rows, {"trials": 20}, {"trials": 1}, True),
    Section("weak-motors", pulses.weak_rows, {"runs": 99}, {"runs": 3}, True),
    Section("matrix", matrix.sample, {"runs": 1600}, {"runs": 2, "plants": 1}, True),
    Section("wander", wander.rows, {"seeds": 40}, {"seeds": 1, "minutes": 0.1}),
    Section("runaway", runaway.rows, {"healthy": 1000, "faulty": 100}, {"healthy": 4, "faulty": 1}),
    Section("imu", imu.rows, {"robots": 30}, {"robots": 1, "share": 0.1}, True),
    Section("imu-mountings", imu.mounting_rows, {"robots": 3}, {"robots": 1, "axes": 1}),
    Section("imu-slides", imu.sliding_wheels, {"robots": 30}, {"robots": 1}, True),
    Section("kit-sensors", kit_sensors.rows, {}, {"sensors": 1}),
    Section("umbmark", chain.umbmark_rows, {"robots": 50}, {"robots": 1}, True),
    Section("chain", chain.rows, {"robots": 30}, {"robots": 1, "steps": 3}, True),
    Section(
        "chain-emulated",
        chain.emulated_rows,
        {"robots": 5},
        "the shortest chain takes 20 s on an emulated board; `chain` runs it on a simulated one",
    ),
    Section("chain-drives", chain.driving_rows, {"robots": 150}, {"robots": 1, "steps": 3}, True),
    Section(
        "calibrated-values",
        calibrated_values.rows,
        {"robots": 40},
        {"robots": 1, "steps": 2, "plants": 1},
        True,
    ),
    Section("range-fit", calibration.range_rows),
    Section("from-log", from_log.rows, {"sets": 200}, {"sets": 1}, True),
    Section("from-log-unmodelled", foreign_logs.rows, {"sets": 200}, {"sets": 1}, True),
    Section("mega", firmware.mega, {"share": 1.0}, {"share": 0, "parts": 6}, True),
    Section("uno", firmware.uno, {"share": 1.0}, {"share": 0, "parts": 6}, True),
    Section("pico", firmware.pico, {"share": 1.0}, {"share": 0, "parts": 3}, True),
    Section("wheel-loop", firmware.wheel_loops, {"share": 1.0}, {"share": 0}, True),
    Section(
        "lowest-speeds", wheel_loop.lowest_speeds, {"count": 10}, {"count": 1, "drivers": 1}, True
    ),
    Section("frames", firmware.damaged_frames, {"count": 10_000_000}, {"count": 10_000}),
    Section("flash", flash.rows, {}, {"cases": 1}),
    Section("radio", radio.rows, {"trials": 30}, {"trials": 3}),
    Section("rosserial", rosserial.rows, {"starts": 100}, {"starts": 1}, True),
    Section("same-end", same_end.rows, {}, {"scenarios": 2}),
    Section("endings", faults.rows, {"trials": 50}, {"trials": 1, "kinds": 2}),
    Section("host-freeze", host_freeze.rows, {"trials": 30}, {"trials": 1, "kinds": 1}),
    Section(
        "map-runs",
        map_runs.rows,
        {"seconds": 120.0, "drives": 10, "length": 60.0},
        {"seconds": 2.0, "drives": 1, "length": 3.0},
        True,
    ),
    Section(
        "map-flats",
        map_flats.rows,
        {"flats": 10, "minutes": 5.0},
        {"flats": 1, "minutes": 0.1},
        True,
    ),
    Section(
        "map-places",
        map_places.rows,
        {"drives": 20, "seconds": 90.0},
        {"drives": 1, "seconds": 8.0},
        True,
    ),
    Section("child-faults", child_faults.rows, {"trials": 10}, {"trials": 1, "kinds": 1}),
    Section("restarts", restarts.rows, {"count": 600}, {"count": 4}),
    Section(
        "first-goal",
        first_goal.rows,
        {},
        "it installs the project from a fresh clone, with which `.ci/run` begins",
    ),
    Section(
        "recordings", recordings.rows, {"trials": 20}, {"trials": 1, "drive_s": 1, "ring": 0.05}
    ),
    Section("hostile-files", hostile.rows, {"count": 200}, {"count": 1, "commands_max": 8}),
    Section("hostile-clients", hostile.client_rows, {"count": 200}, {"count": 2}),
    Section("memory", hostile.memory_rows, {"hours": 24}, {"hours": 0.02}),
    Section("dashboard-memory", dashboard_hours.rows, {"hours": 4}, {"hours": 0.05}, True),
    Section(
        "operators",
        operator_people.rows,
        {"trials": 20, "lines": 2000},
        {"trials": 1, "lines": 10},
    ),
    Section(
        "dashboard",
        dashboard.rows,
        {"trials": 5},
        {"trials": 1, "kinds": 1, "starts": 1, "load_s": 1},
        True,
    ),
    Section("viewers", viewers.rows, {"trials": 20}, {"trials": 1, "load_s": 1}),
    Section("page", page.rows, {"opened": 10}, {"opened": 1, "load_s": 1, "taps": 1}, True),
    Section("phones", page_losses.rows, {"trials": 20}, {"trials": 1, "kinds": 2}),
    Section(
        "loads",
        operator_load.rows,
        {"rounds": 4},
        {"rounds": 1, "segment_s": 0.5, "settling_s": 0.5},
        True,
    ),
    Section("messages", extending.message_rows),
    Section("round-trips", extending.round_trip_rows, {"seconds": 10}, {"seconds": 1.5}, True),
    Section("programs", extending.failure_rows, {"failures": 5}, {"failures": 1, "kinds": 2}),
    Section(
        "silent-reader",
        extending.silent_reader_rows,
        {"requests": 100_000, "stops": 20},
        {"requests": 1000, "stops": 1},
    ),
    Section("ros2", ros2.rows, {"repeats": 3}, {"repeats": 1, "load_s": 1}),
    Section("ros2-chain", ros2_chain.rows, {"repeats": 2}, {"repeats": 1}),
    Section(
        "several-robots",
        several_robots.rows,
        {"repeats": 3},
        {"repeats": 1, "simulated_s": 2},
        True,
    ),
    Section(
        "cut-links",
        several_robots.cut_rows,
        {"trials": 5},
        "a cut and what is looked at after it take half a minute",
    ),
    Section("far-operator", far_operator.rows, {"trials": 6}, {"trials": 1}),
    Section(
        "mutations",
        mutations.rows,
        {"mutations": 3},
        "one mutation takes as long as `make test`, which it runs",
    ),
)


def optiodom(folders: list[Path], seed: int) -> Iterator[Row]:
    """Sessions of the OptiOdom data set, which does not ship, as they are and corrupted."""
    yield from calibration.rows(folders)
    yield from from_log.session_rows(seed, folders)


def main() -> int:
    """Print all rows. Returns the exit code."""
    names = [*(each.name for each in SECTIONS), "optiodom", "maps"]
    parser = arguments("python -m prove", __doc__, names)
    parser.add_argument(
        "--optiodom", type=Path, nargs="*", default=[], help="folders of the OptiOdom data set"
    )
    parser.add_argument(
        "--slam", type=Path, nargs="*", default=[], help="folders of recorded scans of lidars"
    )
    options = parser.parse_args()
    # A background shell may have had them ignored, and every program started here would be, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    data = Section("optiodom", partial(optiodom, options.optiodom))
    scans = Section("maps", partial(maps.rows, options.slam))
    with tempfile.TemporaryDirectory() as state:
        os.environ["XDG_STATE_HOME"] = state  # keep the user's own black-box files
        return prove("prove", [*SECTIONS, data, scans], options)


if __name__ == "__main__":
    raise SystemExit(main())
