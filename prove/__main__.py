"""Run every section and print each figure beside its target: `python -m prove --seed N`."""

from __future__ import annotations

import argparse
import os
import signal
import tempfile
from itertools import chain as joined
from pathlib import Path

from diffbotctl.testing.trials import (
    calibrated_values,
    calibration,
    from_log,
    ports,
    radio,
    rosserial,
    wander,
)
from diffbotctl.testing.trials.row import printed
from prove import (
    chain,
    extending,
    faults,
    firmware,
    first_goal,
    hostile,
    imu,
    matrix,
    model,
    motion,
    operator,
    plants,
    recordings,
    ros2,
    ros2_chain,
    several_robots,
)


def main() -> int:
    """Print all rows. Returns the exit code: 1 when a row is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robots", type=int, default=300)
    parser.add_argument("--goals", type=int, default=50, help="of each row of both plants")
    parser.add_argument("--matrix", type=int, default=272, help="runs of the matrix")
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--faulty", type=int, default=30, help="robots with planted faults")
    parser.add_argument("--emulated", type=int, default=5, help="further ones, on emulated boards")
    parser.add_argument("--drives", type=int, default=200, help="sets of recorded drives")
    parser.add_argument("--calibrated", type=int, default=100, help="robots whose values are read")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--board", type=float, default=1.0, help="fraction of the board trials")
    parser.add_argument("--wander", type=int, default=50, help="seeds, 30 minutes each")
    parser.add_argument("--hostile", type=int, default=200, help="hostile files of each kind")
    parser.add_argument("--failures", type=int, default=5, help="of programs, of each kind")
    parser.add_argument("--bridge", type=int, default=3, help="failures beside ROS 2, of each kind")
    parser.add_argument("--cuts", type=int, default=5, help="of the link to two robots")
    parser.add_argument("--hours", type=float, default=24.0, help="simulated, memory measured")
    parser.add_argument(
        "--optiodom", type=Path, nargs="*", default=[], help="folders of the OptiOdom data set"
    )
    options = parser.parse_args()
    # A background shell may have had them ignored, and every program started here would be, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    state = tempfile.TemporaryDirectory()
    os.environ["XDG_STATE_HOME"] = state.name  # keep the user's own black-box files
    sections = (
        motion.rows(options.seed, options.robots, list(motion.ROBOTS)),
        plants.rows(options.seed, options.goals),
        matrix.sample(options.seed, options.matrix),
        rosserial.rows(options.seed, options.starts),
        faults.rows(options.seed, options.trials),
        firmware.rows(options.seed, options.board),
        first_goal.rows(),
        calibration.rows(options.optiodom),
        from_log.rows(options.seed, options.drives, options.optiodom),
        calibrated_values.rows(options.seed, options.calibrated),
        ports.rows(),
        radio.rows(options.seed, max(6, round(30 * options.board))),
        model.rows(),
        wander.rows(options.seed, options.wander),
        operator.rows(options.seed, min(options.trials, 20), 2000),
        recordings.rows(options.seed, min(options.trials, 20)),
        chain.rows(options.seed, options.robots, options.faulty, options.emulated),
        calibration.range_rows(options.seed),
        hostile.rows(options.seed, options.hostile, options.hours),
        extending.rows(options.failures),
        ros2.rows(options.bridge),
        ros2_chain.rows(50.0, 2),
        several_robots.rows(options.cuts),
        imu.rows(options.seed, max(5, options.robots // 10)),
    )
    missed = printed(joined.from_iterable(sections))
    state.cleanup()
    print(f"{missed} rows missed")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
