"""The base class of drivers: read a device of the computer, such as a USB lidar or a joystick.

A driver opens its device without waiting, and turns the bytes that come into messages:

    class Thermometer(DeviceDriver):
        '''Read a thermometer that sends one line for each value.'''
        device = Param(str, help="Path of its serial port.")
        temperature = Out(Temperature)
        def open(self) -> int: ...
        def read(self, now: int) -> list[Reading]: ...

The engine calls `read` when the opened file is readable, and records what it returns as an input of
the run: a replay gives the same messages without the device. So only a driver may do I/O, and
nothing in `read` may wait.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from diffbotctl.block import inputs, outputs
from diffbotctl.log import QUIET, Log
from diffbotctl.params import declared


class Reading(NamedTuple):
    """A message for the output `port`. None: nothing more will come on it until the next message.

    Without that None, an output on which nothing comes within the timeout of the source counts as
    lost. It is for a driver that publishes on demand, such as one of a joystick.
    """

    port: str
    message: Any


class DeviceError(Exception):
    """The device cannot be opened or read: the cause, and what the user can do."""

    def __init__(self, cause: str, fix: str, is_final: bool = False) -> None:
        """`is_final`: it stays so until a person changes it; at its start the run then ends."""
        super().__init__(cause)
        self.cause = cause
        self.fix = fix
        self.is_final = is_final


class DeviceDriver:
    """Base class of all drivers of devices. The instance is made once; it may be opened often.

    `poll_period`: seconds between two calls of `read`, for a device without a file to wait for, or
    a driver that publishes regularly; None: only when the file is readable.
    `start_timeout`: seconds from `open` to the first message; without one by then, the device is
    closed and opened again. `is_on_demand`: silence is no fault, because the device sends only what
    changes. `log` is set by the engine.
    `virtual_delay`: of a driver that only computes, in a process of its own: in a simulation each
    message that it takes is answered after so much of the simulation's time (ns), for which the
    engine waits, so that the run is the same each time.
    `open_kinds`: for a driver whose outputs and inputs are those that the pipeline declares, `out`
    and `in`: the message classes that they may have. `outputs` and `inputs`: the message class of
    each port of this source, set by the engine.
    """

    poll_period: float | None = None
    start_timeout = 5.0
    is_on_demand = False
    open_kinds: tuple[type, ...] = ()
    virtual_delay: int | None = None
    log: Log = QUIET
    outputs: Mapping[str, type]
    inputs: Mapping[str, type]

    def __init_subclass__(cls) -> None:
        takes_messages = cls.write is not DeviceDriver.write
        if inputs(cls) and not takes_messages:
            raise TypeError(f"{cls.__name__} has inputs: define write(self, now, port, message)")
        if not (outputs(cls) or takes_messages):
            raise TypeError(f"{cls.__name__} has no output: declare one with Out(...)")

    def __init__(self, **values: Any) -> None:
        for name, declaration in declared(type(self)).items():
            setattr(self, name, values.pop(name, declaration.default))
        if values:
            raise TypeError(f"{type(self).__name__} has no parameter {', '.join(values)}")

    def device_name(self) -> str:
        """The device as errors name it: the parameter `device`, if there is one."""
        return str(getattr(self, "device", ""))

    def open(self) -> int | None:
        """Open the device without waiting. Returns the file descriptor to wait for, or None.

        The state of what was read before is reset. Raises OSError or DeviceError.
        """
        raise NotImplementedError

    def read(self, now: int) -> Iterable[Reading]:
        """What has come by `now` (ns), in order; it may be nothing. It must not wait.

        The time of a message is when it was true: `now`, or earlier. Raises OSError or DeviceError
        when the device is gone.
        """
        raise NotImplementedError

    def write(self, now: int, port: str, message: Any) -> None:
        """Send the newest message of an input to the device. It must not wait.

        It is not called while the device is closed. What cannot be sent is dropped, so that no old
        command moves anything after a reconnect. Raises OSError or DeviceError when the device is
        gone.
        """
        raise NotImplementedError

    def answer(self) -> Any:
        """Wait for the answer to the oldest message that has none. For `virtual_delay` only."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the device, also after an error; it may be closed already."""
