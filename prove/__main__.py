"""Run every section and print each figure beside its target: `python -m prove --seed N`."""

from __future__ import annotations

import argparse
import os
import signal
import tempfile
from pathlib import Path

from diffbotctl.emulator.program import cache
from prove import (
    chain,
    extending,
    far_operator,
    faults,
    firmware,
    first_goal,
    hostile,
    imu,
    kit_sensors,
    matrix,
    model,
    motion,
    mutations,
    operator,
    plants,
    recordings,
    ros2,
    ros2_chain,
    several_robots,
)
from tests.support.trials import (
    calibrated_values,
    calibration,
    foreign_logs,
    from_log,
    ports,
    radio,
    rosserial,
    wander,
)
from tests.support.trials.progress import ProofSection, SectionTimes, with_progress
from tests.support.trials.row import printed


def arguments() -> argparse.Namespace:
    """The numbers of trials, from the command line."""
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
    parser.add_argument("--mutations", type=int, default=24, help="of the program")
    parser.add_argument(
        "--optiodom", type=Path, nargs="*", default=[], help="folders of the OptiOdom data set"
    )
    return parser.parse_args()


def sections_of(options: argparse.Namespace) -> list[ProofSection]:
    """All sections in their order; nothing is measured yet."""
    radio_trials = max(6, round(30 * options.board))
    imu_robots = max(5, options.robots // 10)
    trials = min(options.trials, 20)
    return [
        ProofSection(
            "motion",
            motion.rows(options.seed, options.robots, list(motion.ROBOTS)),
            options.robots,
        ),
        ProofSection("plants", plants.rows(options.seed, options.goals), options.goals),
        ProofSection("matrix", matrix.sample(options.seed, options.matrix), options.matrix),
        ProofSection("rosserial", rosserial.rows(options.seed, options.starts), options.starts),
        ProofSection("faults", faults.rows(options.seed, options.trials), options.trials),
        ProofSection("firmware", firmware.rows(options.seed, options.board), options.board),
        ProofSection("first goal", first_goal.rows()),
        ProofSection("calibration", calibration.rows(options.optiodom)),
        ProofSection(
            "calibration from logs",
            from_log.rows(options.seed, options.drives, options.optiodom),
            options.drives,
        ),
        ProofSection(
            "calibration from logs of unmodelled robots",
            foreign_logs.rows(options.seed, options.drives),
            options.drives,
        ),
        ProofSection(
            "calibrated values",
            calibrated_values.rows(options.seed, options.calibrated),
            options.calibrated,
        ),
        ProofSection("ports", ports.rows()),
        ProofSection("radio", radio.rows(options.seed, radio_trials), radio_trials),
        ProofSection("model", model.rows()),
        ProofSection("wander", wander.rows(options.seed, options.wander), options.wander),
        ProofSection("operator", operator.rows(options.seed, trials, 2000), trials),
        ProofSection("recordings", recordings.rows(options.seed, trials), trials),
        ProofSection(
            "chain",
            chain.rows(options.seed, options.robots, options.faulty, options.emulated),
            options.robots,
        ),
        ProofSection("range sensors", calibration.range_rows(options.seed)),
        ProofSection(
            "hostile files",
            hostile.rows(options.seed, options.hostile, options.hours),
            options.hostile,
        ),
        ProofSection("programs", extending.rows(options.failures), options.failures),
        ProofSection("ROS 2", ros2.rows(options.bridge), options.bridge),
        ProofSection("chain of ROS 2", ros2_chain.rows(50.0, 2)),
        ProofSection("several robots", several_robots.rows(options.cuts), options.cuts),
        ProofSection("far operator", far_operator.rows(options.cuts), options.cuts),
        ProofSection("sensors of kits", kit_sensors.rows(options.seed)),
        ProofSection("IMU", imu.rows(options.seed, imu_robots), imu_robots),
        ProofSection(
            "mutations", mutations.rows(options.seed, options.mutations), options.mutations
        ),
    ]


def main() -> int:
    """Print all rows. Returns the exit code: 1 when a row is missed."""
    options = arguments()
    # A background shell may have had them ignored, and every program started here would be, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    state = tempfile.TemporaryDirectory()
    os.environ["XDG_STATE_HOME"] = state.name  # keep the user's own black-box files
    times = SectionTimes(cache() / "prove_times.json")
    missed = printed(with_progress(sections_of(options), times))
    state.cleanup()
    print(f"prove: {missed} rows missed")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
