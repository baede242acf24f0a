"""From a robot file to its simulated self."""

from __future__ import annotations

from random import Random

from diffbotctl.config.boards import SIMULATED
from diffbotctl.config.configuration import Configuration
from diffbotctl.config.robot import Robot, Side
from diffbotctl.drivers.simulated import Simulated
from diffbotctl.plant.machine import Machine, Mounting
from diffbotctl.plant.robot import SimulatedRobot
from diffbotctl.plant.speed_loop import Gains
from diffbotctl.plant.world import Round, Wall, World

SECOND = 1_000_000_000


def simulated(configuration: Configuration, seed: int) -> Simulated:
    """The simulated robot of a configuration, drawn by `seed` from its `simulation` section."""
    robot, nominal = configuration.robot, configuration.nominal
    assert robot is not None and nominal is not None
    plant = drawn(robot, nominal, seed, world(configuration))
    return Simulated(plant, takes_duty(robot))


def drawn(robot: Robot, nominal: Robot, seed: int, around: World | None = None) -> SimulatedRobot:
    """The plant of a robot: it is what the file states, its board is told what was calibrated."""
    return SimulatedRobot(
        board_kind(robot), machine(robot, nominal), nominal.simulation, Random(seed), around
    )


def board_kind(robot: Robot) -> str:
    """`stock`, `counts`, `edges` or `simulated`: how this robot's board answers."""
    if robot.board.type == SIMULATED:
        return SIMULATED
    if robot.link.protocol == "rosserial":
        return "stock"
    return "edges" if robot.board.edge_times else "counts"


def takes_duty(robot: Robot) -> bool:
    """True for a board that has no wheel-speed loop of its own."""
    return robot.link.protocol == "rosserial"


def machine(robot: Robot, nominal: Robot | None = None) -> Machine:
    """What the plant must know: `nominal` is how the robot was built, `robot` what is told of it.

    Without `nominal` nothing was calibrated.
    """
    built = (nominal or robot).drive
    drive = robot.drive
    return Machine(
        track=built.track,
        left_diameter=built.left.wheel.diameter,
        right_diameter=built.right.wheel.diameter,
        rated=built.left.motor.rated,
        slots=drive.left.encoder.slots,
        glitch=round(drive.left.encoder.glitch * SECOND),
        deadman=round(robot.board.deadman * SECOND),
        gains=(gains(drive.left), gains(drive.right)),
        reversed=(drive.left.motor.reversed, drive.right.motor.reversed),
        # A real board has its own beat; one that exists in the simulator alone has the file's.
        period=round(SECOND / robot.board.telemetry) if robot.board.type == SIMULATED else None,
        falling=drive.left.encoder.edge == "falling",
        sensors=tuple(
            Mounting(name, sensor.at.x, sensor.at.y, sensor.at.heading, sensor.type)
            for name, sensor in robot.sensors.items()
        ),
        disc=built.left.encoder.slots,
        divider=None if robot.battery.pin is None else robot.battery.divider or 1.0,
        built_divider=(nominal or robot).battery.divider or 1.0,
        low=robot.battery.low,
        channels=_taken(*(side.motor.enable for side in (drive.left, built.left, built.right))),
        sockets=_taken(*(side.encoder.pin for side in (drive.left, built.left, built.right))),
    )


def _taken(told: object, left: object, right: object) -> tuple[int, int]:
    """Which stated side's pins each side of the board takes: exchanged when the left one is
    `told` what was stated for the `right`."""
    return (1, 0) if str(told) == str(right) != str(left) else (0, 1)


def gains(side: Side) -> Gains:
    """Gains of one wheel's speed loop, with the feed-forward's slope worked out if none is set."""
    loop, rated = side.motor.loop, side.motor.rated
    slope = loop.speed if loop.speed is not None else (1.0 - loop.static) / rated
    return Gains(loop.static, slope, loop.proportional, loop.integral)


def world(configuration: Configuration) -> World:
    """Walls and obstacles of the pipeline."""
    walls = [Wall(*wall.start, *wall.end) for wall in configuration.world.walls]
    rounds = [Round(*obstacle.at, obstacle.radius) for obstacle in configuration.world.obstacles]
    return World(walls, rounds, configuration.world.field)
