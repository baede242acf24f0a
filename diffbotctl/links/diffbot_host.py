"""Host side of the protocol `diffbot`: handshake, commands, stops, telemetry. Sans-IO.

The handshake: find the board's baud rate (`BaudSearch`), ask for its hello, send it the robot's
settings until it uses them. Then the link is up until frames stop arriving. `diffbot_states` has
every change of state; `CommandSender` handles commands and stops.
"""

from __future__ import annotations

from typing import assert_never

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.board_search import (
    BaudSearch,
    other_board,
    refused_setting,
    settings_timeout,
    wrong_version,
)
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.links.diffbot_commands import CommandSender
from diffbotctl.links.diffbot_frames import ActionCode, ItemCode, ModeCode, RefusalCode, ResetCode
from diffbotctl.links.diffbot_ranges import further_range, range_fault
from diffbotctl.links.diffbot_settings import BAUDS, FIRST_BAUD, BoardSettings, settings_name
from diffbotctl.links.diffbot_states import (
    BATTERY_STOP_TEXT,
    LINK_STATES,
    TRANSITIONS,
    HostEvent,
    HostState,
    gyro_cause,
    gyro_fix,
    storm_text,
)
from diffbotctl.links.diffbot_telemetry import RawEdge, State, Telemetry, volts_of
from diffbotctl.links.link_protocol import BITS_PER_BYTE, USB_BAUD, LinkOutput, Refusal
from diffbotctl.messages import Battery, Duty, Encoders, Link, Text, Wheels
from diffbotctl.time import MILLISECOND, NEVER, SECOND

ASK_PERIOD = 250 * MILLISECOND
SETTINGS_PERIOD = 600 * MILLISECOND  # 40 bytes, and their answer, take 60 ms at 9600 baud
STALE_TIMEOUT = 250 * MILLISECOND
LOST_TIMEOUT = SECOND
SETTINGS_SILENCE_TIMEOUT = 2 * SECOND  # a board silent over its settings is searched for again
GYRO_START_TIMEOUT = 1_500 * MILLISECOND  # it is trusted 0.4 s after its settings
SETTLE_TIMEOUT = 10 * SECOND  # until a board must have taken its settings
# Opening a USB port resets the board, and each byte that arrives too early keeps it in its
# bootloader. The firmware sends a hello when it starts.
USB_QUIET_TIME = 1_500 * MILLISECOND
# States in which only state frames keep the link: without them nothing is known of the wheels.
DRIVING_STATES = (HostState.UP, HostState.STALE)
SILENT = "the board has gone silent"
REPEATED = "the board repeats the same frame"
CLOCK_STANDS = "the time in the board's frames does not advance"


class DiffbotHost:
    """Host side of the link to one board with our firmware. Fulfils LinkProtocol.

    `baud` is the rate the port must have now; it changes when another is tried. Output ports:
    `encoders`, the distance sensor's name, `battery`, `link`, `text`, and `stop` when the board
    itself holds the robot (with an empty code when the hold ends).
    """

    def __init__(self, settings: BoardSettings) -> None:
        self.settings = settings
        self.state = HostState.CLOSED
        self.cause = ""
        """why the link is not up"""
        self.refusal: Refusal | None = None
        self.hello: frames.HelloFrame | None = None
        """the board's description of itself; None while none has answered"""
        self.edges: list[RawEdge] = []
        """raw edges, while `capture` is on; the reader empties the list"""
        self._settings_frame = settings.frame()
        self._settings_mark = settings.mark()
        rates = (
            # The board keeps the baud rate of the settings that it was given last.
            (settings.baud, FIRST_BAUD, USB_BAUD, *BAUDS)
            if settings.uart or settings.shares_usb
            else (USB_BAUD, settings.baud)
        )
        self._search = BaudSearch(rates)
        self.baud = self._search.rate
        self._decoder = FrameDecoder()
        self._telemetry = Telemetry(self.baud)
        self._commands = CommandSender(settings.deadman, self._telemetry)
        self._range_faults: dict[str, str] = {}  # by sensor
        self._boot: int | None = None
        self._was_up = False
        self._awaits_gyro = settings.gyro is not None  # no command is sent before it has worked
        self._gyro_due = NEVER
        self._silence = SILENT  # why the link became stale
        self._last_state: State | None = None
        self._forget_board(0)

    def _forget_board(self, now: int) -> None:
        self.hello = None
        self._last_frame_at = NEVER
        self._delimiter_due = True  # a delimiter goes in front of the first frame
        self._line_free_at = self._quiet_until = self._ask_at = now
        self._settings_at = self._settle_until = NEVER
        self._search.begin(now, self.baud)
        self._commands.reset(now)

    # --- the port ---

    def opened(self, now: int) -> None:
        """Forget the board and start the handshake."""
        self._decoder = FrameDecoder()
        self._forget_board(now)
        if not self.settings.uart:
            self._quiet_until = now + USB_QUIET_TIME
            self._search.begin(self._quiet_until, self.baud)
        self._enter(now, HostEvent.PORT_OPENED)

    def closed(self, now: int, cause: str) -> LinkOutput:
        return self._enter(now, HostEvent.PORT_CLOSED, cause)

    def receive(self, now: int, data: bytes) -> LinkOutput:
        """Take bytes; return the messages that they complete."""
        if self.hello is None:
            self._search.receive(data)
        output: LinkOutput = []
        for frame in self._decoder.feed(data):
            if self._has_unknown_mode(frame) or self._is_old(now, frame):
                continue
            self._quiet_until = now
            if isinstance(frame, State) or self.state not in DRIVING_STATES:
                self._last_frame_at = now
            output += self._on_frame(now, frame)
        return output

    def _has_unknown_mode(self, frame: frames.Frame) -> bool:
        """True for a state with an unknown mode of the motors; it counts as no frame at all."""
        if not isinstance(frame, State):
            return False
        is_unknown = ModeCode.find(frame.mode) is None
        self._silence = f"the board reports an unknown mode, {frame.mode}" if is_unknown else SILENT
        return is_unknown

    def _is_old(self, now: int, frame: frames.Frame) -> bool:
        """True for a state frame that is not newer than the last one; it counts as no frame.

        A board that runs advances time and number of each frame. Where they stand still, or a line
        delivers a frame late or twice, its counts and ages belong to no time that is known.
        """
        if not isinstance(frame, State):
            return False
        is_repeated, self._last_state = frame == self._last_state, frame
        if not is_repeated and (frame.boot != self._boot or self._telemetry.is_newer(now, frame)):
            return False
        self._silence = REPEATED if is_repeated else CLOCK_STANDS
        return True

    # --- commands ---

    def command(self, now: int, command: Wheels | Duty) -> None:
        """Take a new command; it replaces one that has not been sent.

        Raises ValueError when it is not finite.
        """
        self._commands.command(now, command)

    def stop(self, now: int) -> None:
        """Drop what waits; send stops until telemetry shows one."""
        self._commands.stop(now)

    def light(self, value: int) -> None:
        """Switch the board's LED: 0 off, 1 on, 2 toggle."""
        self._commands.act(ActionCode.LIGHT, value)

    def capture(self, now: int, on: bool) -> None:
        """Switch the capture of raw edges of both encoders, into `edges`."""
        self._commands.act(ActionCode.CAPTURE, int(on))

    def stop_frame(self) -> bytes:
        """A stop, for the process that stops the board when this one has died."""
        return self._commands.stop_bytes()

    @property
    def stopped(self) -> bool:
        """True when telemetry has shown the last stop."""
        return self._commands.confirmed

    # --- the link ---

    def link(self, now: int) -> Link:
        telemetry, decoder = self._telemetry, self._decoder
        return Link(
            now,
            LINK_STATES[self.state],
            decoder.received,
            decoder.damaged,
            telemetry.lost,
            telemetry.boots,
            telemetry.latency,
            self.cause,
        )

    @property
    def rate(self) -> float:
        """State frames a second; nan before there were two."""
        return self._telemetry.rate

    def _enter(self, now: int, event: HostEvent, cause: str = "") -> LinkOutput:
        """Change the state; the message that shows it."""
        self.state, self.cause = TRANSITIONS[self.state][event], cause
        return [("link", self.link(now))]

    def _refuse(self, now: int, event: HostEvent, refusal: Refusal) -> LinkOutput:
        """This board cannot be driven. A board that was up before may recover: no refusal then."""
        if not self._was_up:
            self.refusal = refusal
        return self._enter(now, event, refusal.cause)

    # --- writing ---

    def due(self) -> int:
        """When a frame is to be sent, or silence to be checked."""
        if self.state is HostState.CLOSED:
            return NEVER
        has_board = self.hello is not None
        frame_at = min(
            self._ask_at,
            self._settings_at,
            self._commands.due(self._may_drive, has_board),
            NEVER if has_board else self._search.probe_at,
        )
        return min(max(self._line_free_at, self._quiet_until, frame_at), self._timeout_at())

    @property
    def _may_drive(self) -> bool:
        return self.state is HostState.UP and not self._awaits_gyro

    def _timeout_at(self) -> int:
        match self.state:
            case HostState.UP:
                return self._last_frame_at + STALE_TIMEOUT
            case HostState.STALE:
                return self._last_frame_at + LOST_TIMEOUT
            case HostState.OPENING | HostState.SEARCHING:
                return self._search.next_rate_at
            case HostState.SETTLING:
                return min(self._last_frame_at + SETTINGS_SILENCE_TIMEOUT, self._settle_until)
            case HostState.CLOSED:
                return NEVER
            case _:
                assert_never(self.state)

    def send(self, now: int) -> bytes:
        """The next frame to write, the most urgent first; empty when none is due."""
        if self.state is HostState.CLOSED or now < max(self._line_free_at, self._quiet_until):
            return b""
        frame = self._next_frame(now)
        if frame is None:
            data = self._search.probe(now) if self.hello is None else b""
        else:
            data = b"\0" * self._delimiter_due + encode(frame)
            self._delimiter_due = False
        self._line_free_at = now + len(data) * BITS_PER_BYTE * SECOND // self.baud
        return data

    def _next_frame(self, now: int) -> frames.Frame | None:
        stop = self._commands.stop_frame(now)
        if stop is not None:
            return stop
        if now >= self._ask_at:
            self._ask_at = now + ASK_PERIOD
            return frames.AskFrame(frames.VERSION)
        if now >= self._settings_at:
            self._settings_at = now + SETTINGS_PERIOD
            return self._settings_frame
        if self._may_drive and self._commands.command_due(now):
            return self._commands.command_frame(now)
        return None if self.hello is None else self._commands.action_frame()

    # --- reading ---

    def _on_frame(self, now: int, frame: frames.Frame) -> LinkOutput:
        if isinstance(frame, frames.HelloFrame):
            return self._on_hello(now, frame)
        if self.hello is None:
            return []  # telemetry from before this handshake
        match frame:
            case frames.StateFrame() | frames.CountsFrame() | frames.InertialFrame():
                return self._on_state(now, frame)
            case frames.AnswerFrame():
                return self._on_answer(now, self.hello, frame)
            case frames.StatusFrame():
                return self._on_status(now, frame)
            case frames.RangeFrame():
                return self._on_range(now, frame)
            case frames.CaptureFrame():
                self.edges += self._telemetry.raw_edges(now, frame)
        return []

    def _on_hello(self, now: int, hello: frames.HelloFrame) -> LinkOutput:
        if hello.version != frames.VERSION:
            self._search.begin(now, self.baud)  # the baud rate is right
            return self._refuse(now, HostEvent.VERSION_DIFFERS, wrong_version(hello.version))
        if hello.board != self.settings.board:
            self._search.begin(now, self.baud)
            refusal = other_board(hello.board, self.settings.board)
            return self._refuse(now, HostEvent.VERSION_DIFFERS, refusal)
        self._ask_at = NEVER
        restart = self._on_restart(now, hello) if self._boot not in (None, hello.boot) else ""
        self._boot, self.hello = hello.boot, hello
        self._settings_mark = self.settings.mark(hello.settings_size)
        if hello.settings == self._settings_mark:
            self._settings_at = NEVER
            return self._link_up(now, hello, restart)
        if self._settle_until == NEVER:
            self._settings_at, self._settle_until = now, now + SETTLE_TIMEOUT
        output: LinkOutput = [("text", Text(now, restart))] if restart else []
        cause = "the board has other settings: sending"
        return output + self._enter(now, HostEvent.SETTINGS_DIFFER, cause)

    def _on_restart(self, now: int, hello: frames.HelloFrame) -> str:
        self._telemetry.restarted()
        self._commands.board_restarted()
        self._ask_at = now  # a board sends telemetry only after a question, and has lost ours
        reset = ResetCode.find(hello.reset) or ResetCode.UNKNOWN
        return f"the board restarted: {reset.meaning}"

    def _link_up(self, now: int, hello: frames.HelloFrame, restart: str = "") -> LinkOutput:
        if self.state is HostState.UP or (self.state is HostState.STALE and not restart):
            return [("text", Text(now, restart))] if restart else []
        self._was_up = True
        self._gyro_due = now + GYRO_START_TIMEOUT
        self._commands.claim(now)  # a board without settings keeps no claim
        text = "; ".join(filter(None, (restart, describe_board(hello))))
        return [("text", Text(now, text)), *self._enter(now, HostEvent.SETTINGS_MATCH)]

    def _on_answer(
        self, now: int, hello: frames.HelloFrame, answer: frames.AnswerFrame
    ) -> LinkOutput:
        refusal = RefusalCode.find(answer.refusal)
        if refusal is RefusalCode.NONE and answer.settings == self._settings_mark:
            self._settings_at = NEVER
            self.hello = hello._replace(settings=answer.settings)
            has_rate = hello.uart or self.settings.shares_usb
            self._change_baud(self.settings.baud if has_rate else USB_BAUD)
            return self._link_up(now, self.hello)
        if refusal in (RefusalCode.MOVING, RefusalCode.OWNED):
            cause = f"settings wait: {refusal.meaning}"
            return self._enter(now, HostEvent.SETTINGS_REJECTED, cause)
        self._settings_at = NEVER
        problem = refused_setting(answer.field, refusal)
        return self._refuse(now, HostEvent.SETTINGS_REJECTED, problem)

    def _on_state(self, now: int, frame: State) -> LinkOutput:
        if frame.boot != self._boot:
            self._ask_at = min(self._ask_at, now)
            return []  # the board restarted: its hello comes first
        output: LinkOutput = []
        stop = self._commands.on_state(now, frame)
        if stop is not None:
            output.append(("stop", stop))
        if self.state is HostState.STALE:
            output += self._enter(now, HostEvent.FRAME)
        encoders = self._telemetry.read(now, frame)
        if isinstance(frame, frames.InertialFrame):
            encoders = self._with_gyro(now, encoders, frame)
        output.append(("encoders", encoders))
        if self.settings.range_channel is not None and frame.range != frames.ANALOG_NONE:
            output.append((self.settings.range_name, self._telemetry.volts(encoders, frame)))
        return output

    def _with_gyro(self, now: int, encoders: Encoders, frame: frames.InertialFrame) -> Encoders:
        """Add sign, unit and fault of the turn. A gyro that has never worked is refused."""
        gyro = self.settings.gyro
        if gyro is None or encoders.turn is None:
            return encoders._replace(turn=None)
        fault = gyro_cause(self._commands.flags) if frame.turn_fault else ""
        if not fault:
            self._awaits_gyro = False
        elif self._awaits_gyro:
            if now >= self._gyro_due:
                self.refusal = Refusal("E-IMU-FAULT", fault, gyro_fix(fault))
                self._gyro_due = NEVER
            return encoders._replace(turn=None)
        return encoders._replace(turn=gyro.true_turn * encoders.turn, turn_fault=fault)

    def _on_range(self, now: int, frame: frames.RangeFrame) -> LinkOutput:
        if frame.sensor >= len(self.settings.further_ranges):
            return []
        sensor = self.settings.further_ranges[frame.sensor]
        message = further_range(self._telemetry.measured_at(now, frame), sensor, frame.value)
        output: LinkOutput = [(sensor.name, message)]
        fault = range_fault(sensor, frame.value)
        if fault != self._range_faults.get(sensor.name, ""):
            self._range_faults[sensor.name] = fault
            output.append(("text", Text(now, fault or f"{sensor.name}: the sensor works again")))
        return output

    def _on_status(self, now: int, status: frames.StatusFrame) -> LinkOutput:
        value = status.value
        if status.item == ItemCode.FLAGS:
            return self._on_flags(now, value)
        if status.item == ItemCode.DROPPED:
            return [("link", self.link(now))]
        if status.item == ItemCode.BATTERY:
            return self._on_battery(now, value)
        return []

    def _on_flags(self, now: int, flags: int) -> LinkOutput:
        before, self._commands.flags = self._commands.flags, flags
        texts = [storm_text(flags)] if storm_text(flags) != storm_text(before) else []
        if flags & ~before & frames.FLAG_BATTERY:
            texts.append(f"the battery is low{self._commands.battery}; {BATTERY_STOP_TEXT}")
        return [("text", Text(now, text)) for text in texts if text]

    def _on_battery(self, now: int, value: int) -> LinkOutput:
        if self.settings.battery_channel is None or value == frames.ANALOG_NONE:
            return []  # no divider, or not measured yet
        volts = volts_of(value) * self.settings.battery_divider
        self._commands.battery = f": {volts:.1f} V, below {self.settings.battery_low:g} V"
        return [("battery", Battery(now, volts, volts < self.settings.battery_low))]

    # --- time ---

    def on_time(self, now: int) -> LinkOutput:
        """Update the state for silence up to `now`: up, stale after 250 ms, lost after 1 s."""
        if now < self._timeout_at():
            return []
        match self.state:
            case HostState.UP:
                self._ask_at = min(self._ask_at, now)
                is_silent = self._silence == SILENT
                cause = "no frames from the board" if is_silent else self._silence
                return self._enter(now, HostEvent.SILENCE, cause)
            case HostState.STALE:
                self._forget_board(now)
                self._commands.claim(now)  # a board that comes back receives a stop first
                self._enter(now, HostEvent.SILENCE, self._silence)
                return [("link", self.link(now)._replace(state="lost"))]
            case HostState.OPENING | HostState.SEARCHING:
                return self._try_next_rate(now)
            case HostState.SETTLING:
                return self._check_settling(now)
            case HostState.CLOSED:
                return []
            case _:
                assert_never(self.state)

    def _try_next_rate(self, now: int) -> LinkOutput:
        self._search.next_rate(now)
        self._change_baud(self._search.rate)
        finding = self._search.finding
        if finding is None:
            return []
        if self._search.final:
            return self._refuse(now, HostEvent.TIMEOUT, finding)
        return self._enter(now, HostEvent.TIMEOUT, finding.cause)

    def _check_settling(self, now: int) -> LinkOutput:
        if now - self._last_frame_at >= SETTINGS_SILENCE_TIMEOUT:
            self._forget_board(now)
            return self._enter(now, HostEvent.SILENCE, SILENT)
        self._settle_until = now + SETTLE_TIMEOUT
        return self._refuse(now, HostEvent.TIMEOUT, settings_timeout(self.cause))

    def _change_baud(self, baud: int) -> None:
        if baud != self.baud:
            self.baud = self._telemetry.baud = baud
            self._delimiter_due = True


def describe_board(hello: frames.HelloFrame) -> str:
    """The board in one line, as a person reads it after flashing."""
    code = frames.BoardCode.find(hello.board)
    board = (code.meaning if code else "") or "an unknown board"
    version = f"{hello.major}.{hello.minor}.{hello.patch}"
    short = board.removeprefix("Arduino ")
    return f"diffbot {version} on {short}, settings {settings_name(hello.settings)}, ready"
