"""The host's half of the protocol `diffbot`: handshake, commands, stops, telemetry. Sans-IO."""

from __future__ import annotations

from math import isfinite
from typing import Final

from diffbotctl.links import diffbot_frames as frames
from diffbotctl.links.diffbot_baud_search import BaudSearch
from diffbotctl.links.diffbot_codec import FrameDecoder, encode
from diffbotctl.links.diffbot_settings import FIRST_BAUD, USB_BAUD, BoardSettings, name_of
from diffbotctl.links.diffbot_telemetry import COMMANDS, RawEdge, Sent, Telemetry, volts_of
from diffbotctl.links.link_protocol import Refusal
from diffbotctl.links.unknown_board import another_version, refused_setting, unsettled
from diffbotctl.messages import Battery, Duty, Link, LinkState, Message, Stop, Text, Wheels
from diffbotctl.time import MILLISECOND, NEVER, SECOND

ASK_EVERY = 250 * MILLISECOND
SETTINGS_EVERY = 600 * MILLISECOND  # 40 bytes, and their answer, take 60 ms at 9600 baud
STOP_EVERY = 60 * MILLISECOND  # a stop and the frame that shows it take about 50
REPEAT_EVERY = 100 * MILLISECOND  # a command lost to noise is made good within the dead-man's time
REPEAT_FOR = 200 * MILLISECOND  # but an engine that has gone silent is not kept driving
TAKE_OVER = 600 * MILLISECOND  # the longest dead-man's time, and a frame
STALE = 250 * MILLISECOND
LOST = SECOND
DEAF = 2 * SECOND  # a board that fell silent over its settings is looked for anew
SETTLE = 10 * SECOND  # until a board must have taken its settings
# Opening a USB port resets the board, and each byte that comes too early keeps it in its
# bootloader. The firmware speaks first when it starts.
USB_QUIET = 1_500 * MILLISECOND
LEFT_FAULT, RIGHT_FAULT = 64, 128  # of the item `flags`
HOLDING = {
    "fault": ("wheel_fault", "a motor had power and its encoder gave no edges: {wheels}"),
    "overruled": ("overruled", "another program or port stopped the robot"),
    "button": ("stop_button", "the stop button is pressed"),
}
UP: Final = "up"
STALE_STATE: Final = "stale"
NEGOTIATING: Final = "negotiating"
OPENING: Final = "opening"
GONE: Final = "lost"

HostOutput = list[tuple[str, Message]]


class DiffbotHost:
    """One board with our firmware behind one port. Fulfils LinkProtocol.

    `baud` is the rate the port must have now; it changes when another is tried. Output ports:
    `encoders`, the distance sensor's name, `battery`, `link`, `text`, and `stop` when the board
    itself holds the robot (code empty when it does no longer).
    """

    def __init__(self, settings: BoardSettings) -> None:
        self.settings = settings
        self._frame = settings.frame()
        self._mark = settings.mark()
        usb = settings.uart == 0
        rates = (USB_BAUD, settings.baud) if usb else (settings.baud, FIRST_BAUD, USB_BAUD)
        self._search = BaudSearch(rates)
        self.baud = self._search.rate
        self.refusal: Refusal | None = None
        self._met_before = False
        self.state: LinkState = GONE
        self.hello: frames.HelloFrame | None = None
        self.edges: list[RawEdge] = []
        """raw edges, when `capture` is on; whoever reads them empties the list"""
        self._decoder = FrameDecoder()
        self._telemetry = Telemetry(self.baud)
        self._sequence = 0
        self._cause = ""
        self._boot: int | None = None
        self._mode = "unset"
        self._held = ""
        self._faults = (False, False)
        self.status: dict[str, int] = {}
        """the slow items last told: uptime (min), loop (us), free_stack (bytes), rejected edges"""
        self._said: Link | None = None
        self._forget_peer(0)

    def _forget_peer(self, now: int) -> None:
        self.hello = None
        self._last_good = NEVER
        self._fresh = True  # a delimiter goes in front of the first frame
        self._line_free = self._ask_at = now
        self._quiet_until = now
        self._settings_at = NEVER
        self._settle_until = NEVER
        self._search.begin(now, self.baud)
        self._stop_sequence: int | None = None
        self._stop_at = NEVER
        self._claimed = now
        self._confirmed = False
        self._wanted: tuple[int, Wheels | Duty] | None = None
        self._repeat_at = NEVER
        self._commanded = -NEVER
        self._actions: list[frames.ActionFrame] = []
        self._clearing = False  # a wheel fault is to be forgotten before the next claim

    # --- the port ---

    def opened(self, now: int) -> None:
        """Forget the peer and start the handshake."""
        self._decoder = FrameDecoder()
        self._forget_peer(now)
        if not self.settings.uart:
            self._quiet_until = now + USB_QUIET
            self._search.begin(now + USB_QUIET, self.baud)
        self.state = OPENING
        self._cause = ""

    def closed(self, now: int, cause: str) -> HostOutput:
        """The port is gone."""
        self.state, self._cause = GONE, cause
        self._stop_at = self._ask_at = self._settings_at = NEVER
        return [("link", self.link(now))]

    def receive(self, now: int, data: bytes) -> HostOutput:
        """Take bytes; return what they say."""
        if self.hello is None:
            self._search.hear(data)
        heard: HostOutput = []
        for frame in self._decoder.feed(data):
            self._last_good = now
            self._quiet_until = now
            heard += self._obey(now, frame)
        return heard

    # --- commands ---

    def command(self, now: int, wanted: Wheels | Duty) -> None:
        """Take a new command; one that still waits is replaced.

        Raises ValueError when it is not finite.
        """
        if not (isfinite(wanted.left) and isfinite(wanted.right)):
            raise ValueError(f"no finite command: {wanted.left}, {wanted.right}")
        moves = wanted.left != 0 or wanted.right != 0
        if self._held and not moves:
            return  # nothing to say: the board holds still
        if self._held:
            self._release(now)
        self._wanted = (now, wanted)
        self._repeat_at = now

    def stop(self, now: int) -> None:
        """Drop what waits; stop, again and again, until telemetry shows it."""
        self._wanted, self._repeat_at = None, NEVER
        self._actions.clear()
        self._claim(now)

    def light(self, now: int, how: int) -> None:
        """The board's LED: 0 off, 1 on, 2 the other way."""
        self._act("light", how)

    def capture(self, now: int, on: bool) -> None:
        """Raw edges of both encoders, in `edges`, while on."""
        self._act("capture", int(on))

    def link(self, now: int) -> Link:
        """State and figures of the link."""
        return Link(
            now,
            self.state,
            self._decoder.received,
            self._decoder.damaged,
            self._telemetry.lost,
            self._telemetry.boots,
            self._telemetry.latency,
            self._cause,
        )

    @property
    def rate(self) -> float:
        """State frames a second; nan before there were two."""
        return self._telemetry.rate

    @property
    def cause(self) -> str:
        """Why the link is not up, in words."""
        return self._cause

    def farewell(self) -> bytes:
        """A stop, for whoever must send it when the host has died; the board would stop anyway."""
        return b"\0" + encode(frames.StopFrame((self._sequence + 1) % COMMANDS))

    @property
    def stopped(self) -> bool:
        """True when telemetry has shown the last stop."""
        return self._confirmed

    def _act(self, name: str, value: int) -> None:
        self._actions.append(frames.ActionFrame(_action(name), value))

    def _claim(self, now: int) -> None:
        self._sequence = (self._sequence + 1) % COMMANDS
        self._stop_sequence, self._stop_at, self._confirmed = self._sequence, now, False
        self._claimed = now

    def _release(self, now: int) -> None:
        """A command after a stop of the board's own: a person has consented, so take over again."""
        self._clearing = self._held == "wheel_fault"
        self._held = ""
        self._claim(now)

    # --- writing ---

    def due(self) -> int:
        """When something is to be written, or silence is to be judged."""
        if self.state == GONE:
            return NEVER
        write = max(self._line_free, self._quiet_until, self._next_write())
        return min(write, self._next_judgement())

    def _next_write(self) -> int:
        times = [self._ask_at, self._settings_at, self._stop_at]
        if self.hello is None:
            times.append(self._search.poke_at)
        if self._may_drive:
            times.append(self._repeat_at)
        if self._actions and self.hello is not None:
            times.append(self._line_free)
        return min(times)

    def _next_judgement(self) -> int:
        if self.state == UP:
            return self._last_good + STALE
        if self.state == STALE_STATE:
            return self._last_good + LOST
        if self.hello is None:
            return self._search.turn_at
        return min(self._last_good + DEAF, self._settle_until)

    @property
    def _may_drive(self) -> bool:
        return self.state == UP and not self._held and self._stop_at == NEVER

    def send(self, now: int) -> bytes:
        """The next frame to write, the most urgent first; empty when none is due."""
        if self.state == GONE or now < max(self._line_free, self._quiet_until):
            return b""
        frame = self._next_frame(now)
        if frame is None:
            data = self._search.poke(now) if self.hello is None else b""
        else:
            data = b"\0" * self._fresh + encode(frame)
            self._fresh = False
        self._line_free = now + len(data) * 10 * SECOND // self.baud
        return data

    def _next_frame(self, now: int) -> frames.Frame | None:
        if self._clearing:
            self._clearing = False
            return frames.ActionFrame(_action("clear"), 0)
        if now >= self._stop_at and self._stop_sequence is not None:
            self._stop_at = now + STOP_EVERY
            self._commanded = now
            self._telemetry.wrote(self._stop_sequence, Sent(now, 0.0, 0.0, "wheels"))
            return frames.StopFrame(self._stop_sequence)
        if now >= self._ask_at:
            self._ask_at = now + ASK_EVERY
            return frames.AskFrame(frames.VERSION)
        if now >= self._settings_at:
            self._settings_at = now + SETTINGS_EVERY
            return self._frame
        if self._may_drive and now >= self._repeat_at:
            return self._command_frame(now)
        if self._actions and self.hello is not None:
            return self._actions.pop(0)
        return None

    def _command_frame(self, now: int) -> frames.Frame | None:
        if self._wanted is None:
            self._repeat_at = NEVER
            return None
        since, wanted = self._wanted
        if now - since > REPEAT_FOR:
            self._wanted, self._repeat_at = None, NEVER
            return None
        if now - self._commanded > self.settings.deadman // 2 or self._mode not in (
            "stopped",
            "speed",
            "duty",
        ):
            self._claim(now)  # the board may have given the commands up: claim them first
            return self._next_frame(now)
        self._sequence = (self._sequence + 1) % COMMANDS
        self._repeat_at = now + REPEAT_EVERY
        self._commanded = now
        self._confirmed = False
        frame, sent = _quantised(now, self._sequence, wanted)
        self._telemetry.wrote(self._sequence, sent)
        return frame

    # --- reading ---

    def _obey(self, now: int, frame: frames.Frame) -> HostOutput:
        if isinstance(frame, frames.HelloFrame):
            return self._met(now, frame)
        if self.hello is None:
            return []  # telemetry of before this handshake: not understood yet
        if isinstance(frame, frames.StateFrame | frames.CountsFrame):
            return self._told(now, frame)
        if isinstance(frame, frames.AnswerFrame):
            return self._answered(now, frame)
        if isinstance(frame, frames.StatusFrame):
            return self._slow(now, frame)
        if isinstance(frame, frames.CaptureFrame):
            self.edges += self._telemetry.raw_edges(now, frame)
        return []

    def _met(self, now: int, hello: frames.HelloFrame) -> HostOutput:
        news = ""
        if hello.version != frames.VERSION:
            self._search.begin(now, self.baud)  # it is found, though of no use
            return self._refuse(now, another_version(hello.version))
        self._ask_at = NEVER
        if self._boot is not None and hello.boot != self._boot:
            news = f"the board restarted: {reset_words(hello.reset)}"
            self._telemetry.restarted()
            self._commanded = -NEVER
            self._wanted = None
            self._ask_at = now  # it talks only to those who ask, and has forgotten that we did
        self._boot, self.hello = hello.boot, hello
        if hello.settings == self._mark:
            self._settings_at = NEVER
            return self._introduce(now, news)
        heard: HostOutput = [("text", Text(now, news))] if news else []
        if self._settle_until == NEVER:
            self._settings_at, self._settle_until = now, now + SETTLE
        return heard + self._negotiate(now, "the board has other settings: sending")

    def _introduce(self, now: int, news: str = "") -> HostOutput:
        if self.state == UP:
            return [("text", Text(now, news))] if news else []
        assert self.hello is not None
        self.state, self._cause = UP, ""
        self._met_before = True
        self._claim(now)  # a board without settings keeps no claim
        text = "; ".join(filter(None, (news, introduction(self.hello))))
        return [("text", Text(now, text)), ("link", self.link(now))]

    def _answered(self, now: int, answer: frames.AnswerFrame) -> HostOutput:
        if answer.settings == self._mark and answer.refusal == 0:
            self._settings_at = NEVER
            assert self.hello is not None
            self.hello = self.hello._replace(settings=answer.settings)
            self._change_baud(self.settings.baud if self.hello.uart else USB_BAUD)
            return self._introduce(now)
        why = frames.REFUSAL.get(answer.refusal, "unknown")
        if why in ("moving", "owned"):
            return self._negotiate(now, f"settings wait: {frames.REFUSAL_MEANING[why]}")
        self._settings_at = NEVER
        return self._refuse(now, refused_setting(answer.field, answer.refusal))

    def _refuse(self, now: int, refusal: Refusal) -> HostOutput:
        """This board cannot be driven. One that could before may yet come back."""
        if not self._met_before:
            self.refusal = refusal
        return self._negotiate(now, refusal.cause)

    def _negotiate(self, now: int, cause: str) -> HostOutput:
        self.state, self._cause = NEGOTIATING, cause
        return [("link", self.link(now))]

    def _told(self, now: int, frame: frames.StateFrame | frames.CountsFrame) -> HostOutput:
        heard: HostOutput = []
        if frame.boot != self._boot:
            self._ask_at = min(self._ask_at, now)
            return heard  # a restart: hello tells more, and comes first
        self._mode = frames.MODE[frame.mode]
        self._check_stop(now, frame)
        heard += self._check_hold(now)
        if self.state == STALE_STATE:
            self.state, self._cause = UP, ""
            heard.append(("link", self.link(now)))
        encoders = self._telemetry.read(now, frame)
        heard.append(("encoders", encoders))
        if self.settings.range_channel is not None and frame.range != frames.ANALOG_NONE:
            heard.append((self.settings.range_name, self._telemetry.volts(encoders, frame)))
        return heard

    def _check_stop(self, now: int, frame: frames.StateFrame | frames.CountsFrame) -> None:
        still = self._mode not in ("speed", "duty")
        if self._mode == "overruled" and now < self._claimed + TAKE_OVER:
            return  # by this very stop, while whoever drove before has only just fallen silent
        if self._stop_sequence is not None and still and frame.command == self._stop_sequence:
            self._stop_sequence, self._stop_at, self._confirmed = None, NEVER, True

    def _check_hold(self, now: int) -> HostOutput:
        code, cause = HOLDING.get(self._mode, ("", ""))
        if code == self._held or self._stop_at != NEVER:
            return []
        self._held = code
        if not code:
            return [("stop", Stop(now, "", "", False))]
        self._wanted, self._repeat_at = None, NEVER
        sides = [name for name, bad in zip(("left", "right"), self._faults, strict=True) if bad]
        wheels = " and ".join(sides) or "see its wiring"
        return [("stop", Stop(now, code, cause.format(wheels=wheels), True))]

    def _slow(self, now: int, status: frames.StatusFrame) -> HostOutput:
        item = frames.ITEM.get(status.item, "")
        self.status[item] = status.value
        if item == "flags":
            self._faults = (bool(status.value & LEFT_FAULT), bool(status.value & RIGHT_FAULT))
        if item == "battery" and self.settings.battery_channel is not None:
            if status.value == frames.ANALOG_NONE:
                return []  # not measured yet
            volts = volts_of(status.value) * self.settings.battery_divider
            return [("battery", Battery(now, volts, volts < self.settings.battery_low))]
        return [("link", self.link(now))] if item == "dropped" else []

    # --- time ---

    def timed(self, now: int) -> HostOutput:
        """Silence, judged."""
        if self.state == GONE:
            return []
        silence = now - self._last_good
        if self.state == UP and silence >= STALE:
            self.state, self._cause = STALE_STATE, "no frames from the board"
            self._ask_at = min(self._ask_at, now)
            return [("link", self.link(now))]
        if self.state == STALE_STATE and silence >= LOST:
            self._forget_peer(now)
            self._claim(now)  # a stop is the first thing a board hears that comes back
            self.state, self._cause = NEGOTIATING, "the board has gone silent"
            lost = self.link(now)._replace(state=GONE)
            return [("link", lost)]
        if self.state in (OPENING, NEGOTIATING):
            return self._look_on(now) if self.hello is None else self._press(now)
        return []

    def _look_on(self, now: int) -> HostOutput:
        """Nobody is known to be there."""
        if now < self._search.turn_at:
            return []
        self._search.turn(now)
        self._change_baud(self._search.rate)
        finding = self._search.finding
        if finding is None:
            return []
        if self._search.final:
            return self._refuse(now, finding)
        return self._negotiate(now, finding.cause)

    def _press(self, now: int) -> HostOutput:
        """The board is known, but has not taken its settings."""
        if now - self._last_good >= DEAF:
            self._forget_peer(now)
            return self._negotiate(now, "the board has gone silent")
        if now >= self._settle_until:
            self._settle_until = now + SETTLE
            return self._refuse(now, unsettled(self._cause))
        return []

    def _change_baud(self, baud: int) -> None:
        if baud == self.baud:
            return
        self.baud = self._telemetry.baud = baud
        self._fresh = True


def _quantised(now: int, sequence: int, wanted: Wheels | Duty) -> tuple[frames.Frame, Sent]:
    """A command in the board's units, and the values that these mean."""
    most = (1 << 15) - 1
    one = frames.SPEED_ONE if isinstance(wanted, Wheels) else frames.DUTY_ONE
    left, right = (
        max(-most, min(most, round(value * one))) for value in (wanted.left, wanted.right)
    )
    if isinstance(wanted, Wheels):
        return (
            frames.CommandFrame(sequence, left, right),
            Sent(now, left / one, right / one, "wheels"),
        )
    return frames.DutyFrame(sequence, left, right), Sent(now, left / one, right / one, "duty")


def _action(name: str) -> int:
    return next(code for code, each in frames.ACTION.items() if each == name)


def introduction(hello: frames.HelloFrame) -> str:
    """The board in one line, as a person reads it after flashing."""
    board = frames.BOARD_MEANING.get(frames.BOARD.get(hello.board, ""), "") or "an unknown board"
    version = f"{hello.major}.{hello.minor}.{hello.patch}"
    short = board.removeprefix("Arduino ")
    return f"diffbot {version} on {short}, settings {name_of(hello.settings)}, ready"


def reset_words(code: int) -> str:
    """Why the board restarted, in words."""
    return str(frames.RESET_MEANING.get(frames.RESET.get(code, "unknown"), "unknown"))
