"""Commands and stops of the protocol `diffbot`: numbered, repeated, confirmed by telemetry.

Sans-IO. A board accepts commands only from the link that owns them, and a link claims them with a
stop. So a stop is sent before the first command, after a pause and after each hold by the board.
"""

from __future__ import annotations

from math import isfinite

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_codec import encode
from diffbotctl.links.diffbot_frames import ActionCode, ModeCode
from diffbotctl.links.diffbot_states import BATTERY_CAUSE, BUTTON_CAUSE, wheel_fault_cause
from diffbotctl.links.diffbot_telemetry import COMMAND_NUMBERS, SentCommand, State, Telemetry
from diffbotctl.messages import Duty, Stop, Wheels
from diffbotctl.time import MILLISECOND, NEVER, SECOND

STOP_PERIOD = 60 * MILLISECOND  # a stop and the frame that shows it take about 50
REPEAT_PERIOD = 100 * MILLISECOND  # a lost command is replaced within the dead-man time
REPEAT_TIMEOUT = 200 * MILLISECOND  # a command is not repeated when the engine is silent
TAKE_OVER_TIMEOUT = 600 * MILLISECOND  # maximum dead-man time, and a frame
UNANSWERED_TIMEOUT = SECOND  # 16 stops in a row are not lost by a radio that works
TELEMETRY_GAP_MAX = 250 * MILLISECOND  # frames after a longer gap may be older than the commands
UNANSWERED_CAUSE = (
    "no command reaches the board, although its telemetry arrives: check the wire to RX of the "
    "board (with a radio module: from its TXD)"
)
INT16_MAX = (1 << 15) - 1
DRIVING_MODES = (ModeCode.SPEED, ModeCode.DUTY)
# Stop code and cause of the modes in which the board itself holds the robot.
HOLDS = {
    ModeCode.FAULT: ("wheel_fault", "{fault}"),
    ModeCode.BATTERY: ("battery_low", BATTERY_CAUSE),
    ModeCode.OVERRULED: ("overruled", "another program or port stopped the robot"),
    ModeCode.BUTTON: ("stop_button", BUTTON_CAUSE),
}


class CommandSender:
    """Selects the next command, stop or action frame. All times are ns.

    `confirmed` is True when telemetry has shown the last stop. `flags` are the board's newest, for
    the cause of a hold.
    """

    def __init__(self, deadman: int, telemetry: Telemetry) -> None:
        """`deadman`: ns without a command after which the board stops the motors."""
        self.flags = 0
        self.battery = ""
        """the last voltage, for the cause of a hold"""
        self._deadman = deadman
        self._telemetry = telemetry
        self._sequence = 0
        self._mode = ModeCode.UNSET
        self._hold: ModeCode | None = None
        self.reset(0)

    def reset(self, now: int) -> None:
        """Discard what waits to be sent: another board may answer next."""
        self.confirmed = False
        self._stop_sequence: int | None = None
        self._stop_at = NEVER
        self._claimed_at = now
        self._commanded_at = -NEVER
        self._actions: list[frames.ActionFrame] = []
        self._clear_fault = False  # clear the hold before the next stop
        self._state_at = now
        self._unanswered_since = now
        self._drop_command()

    # --- requests ---

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Take a new command; it replaces one that has not been sent.

        Raises ValueError when it is not finite.
        """
        if not (isfinite(command.left) and isfinite(command.right)):
            raise ValueError(f"no finite command: {command.left}, {command.right}")
        if self._hold is not None:
            if command.left == 0 and command.right == 0:
                return  # the board holds the robot already
            self._release(now)
        self._pending: tuple[int, Wheels | Duty] | None = (now, command)
        self._repeat_at = now

    def stop(self, now: int) -> None:
        """Discard what waits; send stops until telemetry shows one."""
        self._drop_command()
        self._actions.clear()
        self.claim(now)

    def claim(self, now: int) -> None:
        """Send a stop with a new number, which also claims the commands for this link."""
        self._sequence = self._stop_sequence = self._next_sequence()
        self._stop_at = self._claimed_at = now
        self.confirmed = False

    def act(self, action: ActionCode, value: int) -> None:
        self._actions.append(frames.ActionFrame(action, value))

    def board_restarted(self) -> None:
        """Drop the command: it was meant for the robot before the restart."""
        self._commanded_at = -NEVER
        self._pending = None

    def stop_bytes(self) -> bytes:
        """A stop with a new number, for a process that stops the board."""
        return b"\0" + encode(frames.StopFrame(self._next_sequence()))

    # --- frames to send ---

    @property
    def may_drive(self) -> bool:
        """True when the board accepts a command now: no hold, no unconfirmed stop."""
        return self._hold is None and self._stop_at == NEVER

    def due(self, is_up: bool, has_board: bool) -> int:
        """Time of the next frame."""
        repeat_at = self._repeat_at if is_up and self.may_drive else NEVER
        action_at = 0 if self._actions and has_board else NEVER
        return min(self._stop_at, repeat_at, action_at)

    def stop_frame(self, now: int) -> frames.Frame | None:
        """The stop that is due, or the action before it that clears a fault."""
        if self._clear_fault:
            self._clear_fault = False
            return frames.ActionFrame(ActionCode.CLEAR, 0)
        if now < self._stop_at or self._stop_sequence is None:
            return None
        self._stop_at = now + STOP_PERIOD
        self._commanded_at = now
        self._telemetry.wrote(self._stop_sequence, SentCommand(now, 0.0, 0.0, "wheels"))
        return frames.StopFrame(self._stop_sequence)

    def command_due(self, now: int) -> bool:
        """True when a command is to be sent or repeated, while the link is up."""
        return self.may_drive and now >= self._repeat_at

    def command_frame(self, now: int) -> frames.Frame | None:
        """The command; a stop when this link may have lost the ownership of the commands."""
        if self._pending is None or now - self._pending[0] > REPEAT_TIMEOUT:
            self._drop_command()
            return None
        claimed = self._mode is ModeCode.STOPPED or self._mode in DRIVING_MODES
        if now - self._commanded_at > self._deadman // 2 or not claimed:
            self.claim(now)
            return self.stop_frame(now)
        self._sequence = self._next_sequence()
        self._repeat_at = now + REPEAT_PERIOD
        self._commanded_at = now
        self.confirmed = False
        frame, sent = _quantise(now, self._sequence, self._pending[1])
        self._telemetry.wrote(self._sequence, sent)
        return frame

    def action_frame(self) -> frames.Frame | None:
        return self._actions.pop(0) if self._actions else None

    # --- telemetry ---

    def on_state(self, now: int, frame: State) -> Stop | None:
        """Take the board's mode.

        Returns a Stop message when a hold by the board begins or ends, or no command reaches it.
        """
        self._mode = ModeCode(frame.mode)
        self._check_stop(now, frame.command)
        return self._check_hold(now) or self._check_claim(now)

    def _check_stop(self, now: int, command: int) -> None:
        if self._mode is ModeCode.OVERRULED and now < self._claimed_at + TAKE_OVER_TIMEOUT:
            return  # this stop overruled the former owner of the commands
        if command == self._stop_sequence and self._mode not in DRIVING_MODES:
            self._stop_sequence, self._stop_at, self.confirmed = None, NEVER, True

    def _check_hold(self, now: int) -> Stop | None:
        hold = self._mode if self._mode in HOLDS else None
        if hold is self._hold or self._stop_at != NEVER:
            return None
        self._hold = hold
        if hold is None:
            return Stop(now, "", "", False)
        self._drop_command()
        code, cause = HOLDS[hold]
        cause = cause.format(fault=wheel_fault_cause(self.flags), volts=self.battery)
        return Stop(now, code, cause, True)

    def _check_claim(self, now: int) -> Stop | None:
        """The stop for a motion that waits for a claim of which telemetry shows nothing."""
        gap, self._state_at = now - self._state_at, now
        if not self._awaits_motion() or gap > TELEMETRY_GAP_MAX:
            self._unanswered_since = now
        if now - self._unanswered_since < UNANSWERED_TIMEOUT:
            return None
        self._unanswered_since = now
        return Stop(now, "commands_lost", UNANSWERED_CAUSE, True)

    def _awaits_motion(self) -> bool:
        """True while a motion is to be sent and the stop before it is unconfirmed."""
        if self._pending is None or self._stop_at == NEVER:
            return False
        command = self._pending[1]
        return command.left != 0 or command.right != 0

    def _release(self, now: int) -> None:
        """A command during a hold is the operator's consent to end it: claim the commands again."""
        self._clear_fault = self._hold in (ModeCode.FAULT, ModeCode.BATTERY)
        self._hold = None
        self.claim(now)

    def _drop_command(self) -> None:
        self._pending, self._repeat_at = None, NEVER

    def _next_sequence(self) -> int:
        return (self._sequence + 1) % COMMAND_NUMBERS


def in_frame(value: float, one: int) -> int:
    """A speed (rad/s) or a duty in the units of a frame, of which `one` is 1."""
    return max(-INT16_MAX, min(INT16_MAX, round(value * one)))


def _quantise(now: int, sequence: int, command: Wheels | Duty) -> tuple[frames.Frame, SentCommand]:
    """A command in the board's units, and the rounded values."""
    one = frames.SPEED_ONE if isinstance(command, Wheels) else frames.DUTY_ONE
    left, right = in_frame(command.left, one), in_frame(command.right, one)
    if isinstance(command, Wheels):
        sent = SentCommand(now, left / one, right / one, "wheels")
        return frames.CommandFrame(sequence, left, right), sent
    sent = SentCommand(now, left / one, right / one, "duty")
    return frames.DutyFrame(sequence, left, right), sent
