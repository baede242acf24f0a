"""Drivers of several robots in one engine: each delivers on the wires of its robot."""

from __future__ import annotations

from collections.abc import Sequence

from diffbotctl.engine.driver import Delivery, Driver, RobotDriver
from diffbotctl.errors import RunError
from diffbotctl.messages import Duty, Wheels


class NamedDriver:
    """`driver`, delivering on wires that begin with the robot's name."""

    def __init__(self, name: str, driver: Driver) -> None:
        self.name, self.driver = name, driver

    def due(self) -> int:
        return self.driver.due()

    def files(self) -> list[int]:
        return self.driver.files()

    def deliver(self, now: int) -> list[Delivery]:
        return [
            Delivery(f"{self.name}.{wire}", message) for wire, message in self.driver.deliver(now)
        ]

    def close(self) -> None:
        self.driver.close()


class RobotGroup:
    """Several robots as one: what stops it stops each of them.

    The loop uses it for the final stop; commands go to each robot by itself.
    """

    def __init__(self, robots: Sequence[tuple[str, RobotDriver]]) -> None:
        self.robots = [robot for _, robot in robots]
        self.drivers = [NamedDriver(name, robot) for name, robot in robots]

    def due(self) -> int:
        """When the next message of any robot arrives."""
        return min(driver.due() for driver in self.drivers)

    def files(self) -> list[int]:
        """Those of all robots."""
        return [file for driver in self.drivers for file in driver.files()]

    def deliver(self, now: int) -> list[Delivery]:
        return [delivery for driver in self.drivers for delivery in driver.deliver(now)]

    def close(self) -> None:
        for driver in self.drivers:
            driver.close()

    def command(self, now: int, command: Wheels | Duty) -> None:
        for robot in self.robots:
            robot.command(now, command)

    def stop(self, now: int) -> None:
        """Stop all; one that is out of reach keeps none of the others from being stopped."""
        failure: RunError | None = None
        for robot in self.robots:
            try:
                robot.stop(now)
            except RunError as error:
                failure = failure or error
        if failure is not None:
            raise failure

    @property
    def stopped(self) -> bool:
        """Whether all have confirmed standstill."""
        return all(robot.stopped for robot in self.robots)
