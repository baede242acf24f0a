"""Every code that a problem or a stop can carry, explained at length for `diffbotctl explain`.

E: cannot work, nothing was started. W: unwise. Small letters: what holds a running robot still.
"""

from __future__ import annotations

from textwrap import dedent
from typing import NamedTuple


class Code(NamedTuple):
    """What a code means, in a few words and in a paragraph or two."""

    title: str
    text: str


def _code(title: str, text: str) -> Code:
    return Code(title, dedent(text).strip())


CODES: dict[str, Code] = {
    "E-DEFECT": _code(
        "diffbotctl itself failed",
        """
        Something happened that nobody foresaw. The robot was stopped before this was printed. Run
        the same command with --debug in front: the traceback that it prints is what we need.""",
    ),
    "E-DISK-FULL": _code(
        "the disk is full",
        """
        What had to be written found no space on its disk. A robot that was driving was stopped
        before this was printed. `df -h` lists the disks and what is left on each; recordings and
        the flights in ~/.local/state/diffbotctl/flights are the first to look at.""",
    ),
    "E-CALIBRATE-LOG": _code(
        "a log to calibrate from that cannot serve",
        """
        `calibrate from-log` reads recordings (.mcap) of ours, and CSV files whose first line names
        the columns: time (s), right and left (counts since the start; backward is less), and where
        known x, y (m) and heading (rad). Where the files do not tell where the robot was, --ends
        names a CSV file with the columns recording, x, y and heading or heading_deg, one line a
        drive; or --truth, once for each file, a CSV file with time (since the drive's start), x, y
        and heading. A drive begins at the origin, looking along x.""",
    ),
    "E-CALIBRATE-FIT": _code(
        "no geometry fits",
        """
        No wheel diameters and no track near the stated ones bring the drives to where they
        ended. Most often the counts per turn of the robot file are wrong, or one wheel is counted
        backwards, or the end poses belong to other drives.""",
    ),
    "E-CALIBRATE-WRITE": _code(
        "results that could not be written",
        """
        Results go into the section `calibration:` of the robot file, a module's new rate into
        `link:`; all else in the file stays as it is, byte for byte. A file that cannot be written,
        or whose layout is too uncommon to change it safely, is left alone: write the entries that
        were shown by hand.""",
    ),
    "E-CALIBRATE-UNDO": _code(
        "nothing to undo",
        """
        Each time that results are written, the file as it was is kept beside the robot file, under
        a name that ends in the fingerprint of what was written. `calibrate undo` puts it back when
        the robot file is still what was written then; if you have changed it since, undoing would
        lose your changes, so it is left to you: compare the two files and copy what you want.""",
    ),
    "E-CALIBRATE-ANSWER": _code(
        "an answers file that cannot answer",
        """
        `calibrate --answers FILE` reads what you would have typed: one question's name a line, and
        the answer behind it; a list holds one answer for each repeat. A name answers every question
        that begins with it, and the longest one counts. On a simulated or emulated robot
        `{measure: tape, noise: 1 mm}` reads what the robot truly did: with a tape (lengths), a
        protractor (headings), the eye (which wheel turned, and which way), a meter (voltages).""",
    ),
    "E-CALIBRATE-STOPPED": _code(
        "a calibration that was stopped",
        """
        The robot was told to stand still, and nothing of this step was written: because somebody
        pressed a key, because the link to the board fell silent, because the board itself had
        stopped the motors, or because something turned further than had been announced. Steps that
        were finished before are in the robot file; begin again with the one that was stopped.""",
    ),
    "E-CALIBRATE-RANGE": _code(
        "a distance sensor that cannot be calibrated",
        """
        The voltages at the rule's distances are not those of a Sharp infrared sensor: they must
        fall from 4 to 30 cm, and stand still while the card does. Closer than 3 cm they fall too,
        which looks like a greater distance. Measure from the sensor's front, use a white card
        that stands upright, and look at the sensor's supply (5 V), ground and output wires.""",
    ),
    "E-CALIBRATE-ROBOT": _code(
        "a robot that cannot be calibrated like this",
        """
        The robot does not do what this step measures: a wheel that does not turn, an encoder that
        does not answer, a scale that no tape would show. Calibrate in the order of the chain
        (encoders, motors, distance, geometry), each of which finds the faults that would spoil the
        next, and mend first what `calibrate encoders` names.""",
    ),
    "E-FLASH": _code(
        "flashing failed",
        """
        Writing the firmware to the board did not work. The bootloader sits in a part of the
        chip that flashing never touches, so the board can be flashed again.""",
    ),
    "E-FLASH-NO-BOARD": _code(
        "no board to flash",
        """
        No serial port looks like an Arduino Mega. Plug the USB cable in; many cables only
        charge and have no data wires. A board shows itself as /dev/ttyACM0 or, with a CH340
        chip, ttyUSB0.""",
    ),
    "E-FLASH-SEVERAL": _code(
        "several boards",
        """
        More than one port looks like a board, and writing to the wrong one would erase its
        program. Say which with --port, or unplug the others.""",
    ),
    "E-FLASH-RADIO": _code(
        "flashing over Bluetooth",
        """
        The bootloader listens on the board's USB port alone; the radio module sits on another
        serial port, which only a running program reads. Use the USB cable.""",
    ),
    "E-FLASH-NO-SYNC": _code(
        "no bootloader answers",
        """
        Opening the USB port resets a Mega, and for most of a second its bootloader listens at
        115200 baud. Nothing answered: a wrong port, a cable without data wires, something wired
        to pins 0 and 1, or a board that does not reset by itself (press its button within that
        second).""",
    ),
    "E-FLASH-SIGNATURE": _code(
        "another chip",
        """
        Every AVR tells three bytes that name its kind. These are not an ATmega2560's, and the
        program for one chip does not run on another. Choose the port of the Mega 2560.""",
    ),
    "E-FLASH-REFUSED": _code(
        "the bootloader refused",
        """
        The bootloader answered a command with a failure. It is still there: flash again, or try
        the other programmer with --programmer avrdude.""",
    ),
    "E-FLASH-VERIFY": _code(
        "read back differently",
        """
        What was read back is not what was written. Flash again. If it always fails at one
        address the chip's memory is worn out there, which takes ten thousand flashings.""",
    ),
    "E-FLASH-SILENT": _code(
        "silent after flashing",
        """
        The program was written and verified, but nothing comes from the board. Press its reset
        button; if it stays silent, flash again.""",
    ),
    "E-FLASH-IMAGE": _code(
        "an unusable image",
        """
        The file is no Intel hex file, has gaps, or does not fit a Mega 2560. This board's
        bootloader erases page after page in order, so an image with gaps would land in pages
        not erased.""",
    ),
    "E-FLASH-AVRDUDE": _code(
        "avrdude is missing or failed",
        """
        The other programmer was asked for. Install it (apt install avrdude), or leave
        --programmer out: diffbotctl has its own.""",
    ),
    "E-RECORDING": _code(
        "a file is no recording",
        """
        Recordings are MCAP files that `run --record FILE` has written. This file cannot be read,
        or holds none of what a recording of diffbotctl begins with.""",
    ),
    "E-RECORDING-CUT": _code(
        "a recording is incomplete",
        """
        A recording ends with a record that says it is whole. This one has none: the program was
        killed, the disk was full, or the recorder could not keep up. What is in the file is true,
        but nobody can say what is missing, so a comparison would prove nothing.""",
    ),
    "E-FIELD": _code(
        "a recording has no such field",
        """
        A field is named as `topic echo` names it: the block, its port and the field of the message,
        with dots between: `odometry.odometry.x`. `bag info FILE` lists the topics that are in a
        recording; a topic that never spoke has no fields to show.""",
    ),
    "E-PICTURE": _code(
        "a picture cannot be written",
        """
        `bag plot --output` writes SVG by itself. A PNG is drawn by the library Pillow, which is not
        installed with diffbotctl: `pip install pillow`.""",
    ),
    "E-FILE-READ": _code(
        "a file cannot be read",
        """
        The file does not exist, is a directory or a device, or you may not read it. Names without
        a slash are looked up in ./pipelines or ./robots first, then among the shipped files.

        Check the spelling and the folder you are in (`pwd`, `ls`). For a permission, `ls -l FILE`
        shows who may read it.""",
    ),
    "E-FILE-WRITE": _code(
        "a file cannot be written",
        """
        The folder is not there, is not yours, or the disc is full; or there is a file of that name
        already, and nothing of yours is ever written over.""",
    ),
    "E-FILE-NAME": _code(
        "no file of that name",
        """
        A name such as `goal` is looked up as ./pipelines/goal.yaml, then among the pipelines that
        are shipped with diffbotctl; robots likewise in ./robots. Neither has it.

        Use one of the names listed, or give a path: ./mine.yaml.""",
    ),
    "E-FILE-SIZE": _code(
        "a file is too large",
        """
        A robot or pipeline file has a few kB. One of several hundred kB is something else, a
        recording perhaps, and reading it would only take long to fail.""",
    ),
    "E-FILE-ENCODING": _code(
        "a file is not UTF-8 text",
        """
        YAML files are text in UTF-8. A file saved as UTF-16 or Latin-1, or no text at all, cannot
        be read. Most editors have `save with encoding` in their menu; choose UTF-8.""",
    ),
    "E-YAML-TOP": _code(
        "the file as a whole is no mapping",
        """
        A file is made of `key: value` lines from its first column. An empty file, a list that
        begins with dashes, or a second document behind `---` is something else.

        Begin it with `format: 1` and `kind: robot` or `kind: pipeline`.""",
    ),
    "E-YAML-SYNTAX": _code(
        "the text is not YAML",
        """
        The reader lost the thread here. Usual reasons: a brace or bracket that was not closed
        (then the true place is earlier), a line that is indented unlike its neighbours, a colon
        without a space behind it, or a quotation mark that does not close.""",
    ),
    "E-YAML-TAB": _code(
        "a tab in the indentation",
        """
        YAML shows by indentation what belongs to what, and a tab is as wide as each editor likes.
        So only spaces are allowed. Let your editor insert spaces for the tab key.""",
    ),
    "E-YAML-DUPLICATE": _code(
        "a key is given twice",
        """
        Two values for one thing: most YAML readers silently take the last, and you would look for
        the reason in the wrong line. Keep one of them.""",
    ),
    "E-YAML-NUMBER": _code(
        "a number that is read in two ways",
        """
        A number with a leading zero, such as 017, is fifteen to YAML 1.1 and seventeen to YAML
        1.2. Pins and counts must not depend on that: write it in decimal without leading zeros.
        A number too large to hold is refused here too.""",
    ),
    "E-YAML-COMMA": _code(
        "a decimal comma",
        """
        In braces a comma ends an entry: `{width: 1,5 m}` is `width: 1` and a second, empty key
        `5 m`. Write a point: `1.5 m`.""",
    ),
    "E-YAML-KEY": _code(
        "something that cannot be a key",
        """
        Keys are plain words. A list, a mapping or an alias cannot be one, and merge keys (`<<`)
        are not read: what two sides share is written once in `drive`, and whole files are
        combined by `include`.""",
    ),
    "E-YAML-ANCHOR": _code(
        "an alias without its anchor",
        """
        `*name` repeats a value that was marked by `&name` further up. It was not, or it stands
        inside that value. Write the value itself, or use `vars:` and `$name`.""",
    ),
    "E-YAML-SIZE": _code(
        "nested or unfolded beyond measure",
        """
        Aliases of aliases can unfold to millions of values out of ten lines, and brackets can nest
        thousands deep. No robot needs either, so reading stops early.""",
    ),
    "E-YAML-TAG": _code(
        "a YAML tag",
        """
        Tags such as !!python/object ask the reader to build objects, which is a way to run code
        out of a file. They are not read. Remove the tag; plain values are enough.""",
    ),
    "E-KEY-UNKNOWN": _code(
        "a key that means nothing here",
        """
        A key that nobody reads would be silently ignored, and the robot would not do what the file
        says. So every key must be known. It is often a slip of spelling, or it stands under the
        wrong section: compare the indentation. `diffbotctl blocks show NAME` lists a block's
        parameters; the schemas let an editor complete them.""",
    ),
    "E-KEY-MISSING": _code(
        "a key that must be given",
        """
        There is no sensible value to assume: the distance between the wheels, or the pin of an
        encoder, is known only to you. What both sides share may stand once in `drive`.""",
    ),
    "E-TYPE": _code(
        "another kind of value is wanted",
        """
        A number, a word, true or false, a list or a mapping was wanted and another one given.
        YAML's `yes` and `on` are plain words here: write true or false. A text that looks like a
        number needs quotes.""",
    ),
    "E-UNIT": _code(
        "a unit of the wrong kind",
        """
        A quantity is a number in SI units, or a number with a unit: 65 mm, 90 deg, 100 rpm,
        300 ms. A length in degrees or an unknown unit is a mistake that would otherwise show as a
        robot that drives off. Letters count: mm is a millimetre, Mm is nothing known here.""",
    ),
    "E-BOUNDS": _code(
        "a value out of bounds",
        """
        The value can be read but cannot be right, or is not safe. The limit is given in the
        message. The board's dead-man's time, for one, is from 100 to 500 ms: shorter, and the robot
        stops between two commands; longer, and at 0.3 m/s it drives on blind for more than 15 cm
        after the link is gone. It cannot be switched off.""",
    ),
    "E-CHOICE": _code(
        "not one of the known words",
        """
        Here only a few words are possible, because each stands for something that the code knows
        how to do. They are listed in the message; a schema-aware editor offers them too.""",
    ),
    "E-VALUE-EMPTY": _code(
        "a key without a value",
        """
        Nothing stands behind the colon. Either the value was forgotten, or it slipped to the next
        line with the wrong indentation, or a comma too many made a key of its own.""",
    ),
    "E-NAME": _code(
        "a name that cannot be used",
        """
        Names of blocks and sensors appear in wires (`range.range`) and on the command line, so they
        are made of small letters, digits and _. `robot` and `operator` are nodes that every
        pipeline has already.""",
    ),
    "E-VAR-UNKNOWN": _code(
        "a variable that is not set",
        """
        `$name` stands for a value from the file's `vars:`. There is none of that name. A dollar
        sign itself is written $$.""",
    ),
    "W-VAR-UNUSED": _code(
        "a variable that is never used",
        """
        It has no effect. Probably the value that it should replace is still written out
        somewhere.""",
    ),
    "E-INCLUDE": _code(
        "an include that cannot be followed",
        """
        `include` names a file that this one changes: a path from here, or a name in the same
        folder or among the shipped files. Mappings are merged, lists and values replaced, this
        file wins. Files cannot include each other in a circle.""",
    ),
    "E-SET": _code(
        "--set that says nothing",
        """
        `--set block.parameter=value` changes one value for this run: --set follower.tolerance='20
        mm', --set robot.limits.speed='0.2 m/s', --set vars.side='1 m'. Quote it in the shell when
        it holds a space.""",
    ),
    "E-CALIBRATION": _code(
        "a calibrated field that does not exist",
        """
        `calibration:` is written by `diffbotctl calibrate`: each key is the path of a field of the
        robot file, such as drive.left.wheel.diameter, and its value is used in the field's place.
        Delete the entry, or correct its path.""",
    ),
    "E-IMPLAUSIBLE": _code(
        "a calibrated value that cannot be true",
        """
        A calibration is believed only near what the robot file states: further off, a rule was
        read wrongly, a drive slipped, or the stated value itself is wrong. Correct whichever it
        is, then calibrate again; or delete the entry, and the stated value holds.""",
    ),
    "W-UNCALIBRATED": _code(
        "what matters was never calibrated",
        """
        Wheels and tracks differ from their labels by some per cent, and a robot's heading after a
        metre with them. The simulated robot is as its file says; a real one is not. Each of the
        calibrations named takes from two to twenty minutes.""",
    ),
    "E-ROBOT-WHICH": _code(
        "several robots, none chosen",
        """
        ./robots holds several files, so it would be a guess which robot is meant. Name one by
        --robot, or by `use:` in the pipeline.""",
    ),
    "E-ROBOT-MISSING": _code(
        "a block needs a robot",
        """
        The block takes its geometry from the robot file, so that no number is typed twice, but this
        pipeline has no `robot:`.""",
    ),
    "E-ROBOT-FIELD": _code(
        "a block asks for a field that robots do not have",
        """
        A block says by FromRobot("drive.track") what it needs of the robot file. This one asks for
        something that no robot file has: the mistake is in the block's own code.""",
    ),
    "E-SENSOR-UNKNOWN": _code(
        "a sensor that the robot does not have",
        """
        Sensors are named under `sensors:` in the robot file, and `robot` has one output of each
        name. A block or the simulation refers to a name that is not there.""",
    ),
    "E-BLOCK-UNKNOWN": _code(
        "no block of that kind",
        """
        `block:` names a kind of block: one that is built in, or one from another installed package.
        `diffbotctl blocks` lists them.""",
    ),
    "E-BLOCK-IMPORT": _code(
        "a block's code cannot be loaded",
        """
        The block is known, but Python failed to import it; the reason stands in the message. If it
        comes from another package, that package is broken or lacks something of its own.""",
    ),
    "E-BLOCK-CLASH": _code(
        "two packages claim one name",
        """
        Two installed packages bring a block or driver of the same name. Which one would run would
        be a matter of luck, so neither does.""",
    ),
    "E-BLOCK-RAISED": _code(
        "a block failed while running",
        """
        The block's own code raised an error. The robot was stopped at once. `--debug` shows where
        in the code it happened; the recording holds the messages that led to it.""",
    ),
    "E-WIRE-NODE": _code(
        "a wire from nowhere",
        """
        A wire stands at its consumer and names its source: in: {twist: limiter.twist}. There is no
        block of that name, or the pipeline has no robot.""",
    ),
    "E-WIRE-OUTPUT": _code(
        "a wire from an output that does not exist",
        """
        The block is there, but it has no such output. `diffbotctl blocks show KIND` lists the
        outputs of a kind; `robot` gives encoders, link, battery and one output for each sensor,
        `operator` gives goal, twist, path and resume.""",
    ),
    "E-WIRE-INPUT": _code(
        "a wire to an input that does not exist",
        """
        The keys under `in:` are the block's inputs; the values are where they come from. This key
        is not one of them. `diffbotctl blocks show KIND` lists the inputs of a kind.""",
    ),
    "E-WIRE-MISSING": _code(
        "an input that nothing feeds",
        """
        The block cannot do its work without this input: it would wait for ever, and the robot
        would stand still without telling why.""",
    ),
    "E-WIRE-TYPE": _code(
        "a wire that carries something else",
        """
        Output and input carry different messages. A Twist is the velocity of the whole body in m/s
        and rad/s; Wheels are the speeds of two wheels in rad/s: `diff_drive` turns one into the
        other. Volts become a Range by `range_sensor`.""",
    ),
    "E-WIRE-LOOP": _code(
        "blocks that wait for each other",
        """
        In each instant every block reacts once, after those that feed it. In a loop none could be
        first. Feedback goes through the world: what the robot did comes back with its encoders, and
        the commands then in force come with them.""",
    ),
    "W-WIRE-WHEELS": _code(
        "nothing drives the wheels",
        """
        The pipeline has a robot but gives it no wheel speeds, so it will only watch. That may be
        what you want; else add robot: {in: {wheels: kinematics.wheels}}.""",
    ),
    "E-PIN-UNKNOWN": _code(
        "a pin that the board does not have",
        """
        The number is not on this kind of board. A Mega 2560 has 0 to 53 and A0 to A15, an
        ATmega328P (Uno, Nano) has 0 to 13 and A0 to A7.""",
    ),
    "E-PIN-PWM": _code(
        "a pin without PWM",
        """
        The enable input of a motor driver takes pulses: the longer they are, the faster the motor
        turns. Only some pins can make such pulses by themselves; on the others the motor could only
        be off or at full speed. Move the EN wire to one of the pins listed.""",
    ),
    "E-PIN-TIMER": _code(
        "a PWM pin whose timer is taken",
        """
        Pulses are made by timers, and each timer serves two or three pins. One of them also
        keeps the board's clock, by which edges are dated and the dead-man's time runs out. Its pins
        can switch, but not drive a motor: with our firmware on a Mega 2560 it is timer 1 with pins
        11 and 12; with the book's it is timer 0, 4 and 13 on a Mega 2560, 5 and 6 on an
        ATmega328P.""",
    ),
    "E-PIN-INTERRUPT": _code(
        "a pin that cannot raise an interrupt",
        """
        An encoder's slot passes in a few milliseconds. The board catches each edge by an interrupt,
        and only some pins have one: 2, 3, 18, 19, 20 and 21 on a Mega 2560, 2 and 3 on an
        ATmega328P. 18 and 19 are also the serial port of the HC-05.""",
    ),
    "E-PIN-ANALOG": _code(
        "a pin that cannot measure",
        """
        The distance sensor gives a voltage, and only the analog pins, A0 and up, can measure one.
        The others see high or low.""",
    ),
    "E-PIN-DIGITAL": _code(
        "a pin that can only measure",
        """
        A6 and A7 of an ATmega328P lead to the converter alone; they cannot switch anything or be
        read as high and low.""",
    ),
    "E-PIN-UART": _code(
        "a pin that carries a serial line",
        """
        The pin belongs to the line on which the board and the computer talk. A motor or encoder on
        it would garble both. Pins 0 and 1 always belong to the USB port.""",
    ),
    "E-PIN-TAKEN": _code(
        "two things on one pin",
        """
        Two wires cannot share a pin: whatever one of them does, happens to the other too.""",
    ),
    "E-START-ANSWER": _code(
        "a question of the guided path without an answer",
        """
        The answers file is a list of questions and answers, one a line, such as `lifted: yes`; or
        nobody is at the terminal to be asked. `diffbotctl start` asks: lifted, measure
        and floor. Names that begin with a calibration's step, such as encoders.wheel, are asked by
        `diffbotctl calibrate`.""",
    ),
    "E-SERVICE-GOALS": _code(
        "a service that would drive off by itself",
        """
        What a service starts, it starts whenever the machine starts, or the board is plugged in
        again: nobody stands beside the robot then. So it must wait for somebody's word.

        `diffbotctl service` takes the pipeline `standby`, which waits; your own needs goals: [].
        """,
    ),
    "E-WIRING-NONE": _code(
        "a robot without wires",
        """
        It lives in the simulator alone (board: {type: simulated}): there is no board to connect
        anything to. `diffbotctl wiring book_2wd` draws the wires of a robot that has one.""",
    ),
    "W-WIRING-LEVEL": _code(
        "5 volts into a 3.3 volt input",
        """
        An HC-05 runs on 5 V, but its receiving input RXD is made for 3.3 V; a Mega's or an Uno's
        transmitting pin gives 5 V. It often works for a while, then the module grows deaf.

        Two resistors divide the voltage: 1 kOhm in the wire, 2 kOhm from RXD to ground. Then leave
        link.level at divider.""",
    ),
    "W-WIRING-SHARED": _code(
        "a radio on the USB port's pins",
        """
        Pins 0 and 1 are also the USB port's. While a module is plugged in there, flashing fails and
        each talks into the other's words.

        On a Mega 2560 use another serial port (uart: 1, pins 18 and 19). On an ATmega328P, which
        has only this one, unplug the module before flashing and before using the USB cable.""",
    ),
    "W-WIRING-LIGHT": _code(
        "a pin that the board's own light shares",
        """
        The light L hangs on pin 13. The bootloader blinks it at each start, so a motor's enable
        input there makes the wheel jerk, and an input there is pulled down by the light on many
        boards, so that a button seems pressed for ever.""",
    ),
    "W-WIRING-SUPPLY": _code(
        "a battery that does not fit",
        """
        A Mega's VIN, and the regulator on the L298N, take 7 to 12 V: below, their 5 V sink whenever
        a motor starts and the board restarts; above, they get too hot. The L298N itself takes up to
        35 V, of which it loses about 2 V.

        board.supply says which of them feeds the board; battery.full is the full battery's voltage:
        8.4 V for two lithium cells, 9 V for six alkaline ones.""",
    ),
    "E-LINK-UART": _code(
        "a serial port that the board does not have",
        """
        A Mega 2560 has the ports 0 (USB) to 3, of which our firmware uses 0 and 1 (pins 18 and 19);
        an ATmega328P has only port 0, which it shares with the USB.""",
    ),
    "E-LINK-BUDGET": _code(
        "more telemetry than the line carries",
        """
        Each byte takes ten bits, so 9600 baud carry about 960 bytes a second. Frames beyond that
        would pile up on the board and be dropped, and the robot would act on old news. Lower
        board.telemetry, send counts without edge times, or raise the baud rate of the HC-05.""",
    ),
    "W-LINK-BUDGET": _code(
        "telemetry that nearly fills the line",
        """
        The line is filled to more than nine tenths. Answers, log lines and settings must fit in
        between, and a damaged frame cannot be made up for.""",
    ),
    "E-DEADMAN": _code(
        "a dead-man's time shorter than the gap between commands",
        """
        The board stops its motors by itself when no command came for board.deadman. Commands go out
        with each frame of telemetry; with frames that rare it would stop between any two.""",
    ),
    "W-DEADMAN": _code(
        "a dead-man's time of few commands",
        """
        Radio links lose a command now and then. When two lost ones outlast the dead-man's time,
        the robot stutters. Send telemetry, and with it commands, more often, or raise
        board.deadman.""",
    ),
    "E-LIMIT-SPEED": _code(
        "a speed limit that the motors cannot reach",
        """
        Rated speed times the wheel's radius is the fastest the robot can drive, with a full battery
        and no load. A limit above makes every plan too optimistic: it would brake too late for
        goals and be stopped by the last gate.""",
    ),
    "E-STOP-REACH": _code(
        "too fast for what the sensor sees",
        """
        From full speed the robot needs v x reaction + v^2 / (2 x braking) to stop. The Sharp
        GP2Y0A41SK0F sees 30 cm. When stopping takes longer, the robot hits what it sees.

        Lower limits.speed, or raise limits.braking if the tyres allow it.""",
    ),
    "W-STOP-REACH": _code(
        "stops, but closer than the margin",
        """
        The robot can stop before it touches, but not with the margin that obstacle_stop keeps.""",
    ),
    "E-TOLERANCE": _code(
        "a goal finer than the robot can tell",
        """
        A disc of 20 slots on a 65 mm wheel counts each 10.2 mm. Between two counts the place is
        known to about 2.9 mm, to half of that when the board tells when each edge came, and to
        about 7 mm with the book's firmware, whose commands arrive at uncertain times. A tolerance
        below would be met by luck only.""",
    ),
    "W-TOLERANCE": _code(
        "a goal about as fine as the robot can tell",
        """
        The tolerance is less than twice the standard deviation of what the robot knows of its own
        place. Goals will be reached, some of them in several tries.""",
    ),
    "W-EDGES": _code(
        "more edges than frames",
        """
        A frame tells how many edges each encoder has counted, and when the last one came. With
        more than one edge a frame, the ones in between have no time, and odometry may take one slot
        for another. Let the board send more often, drive slower, or leave out the edge times.""",
    ),
    "W-BODY-TYRES": _code(
        "a body narrower than its tyres",
        """
        `body.width` is the whole width of the robot, tyres included. Blocks that keep clear of
        walls, the map, the simulated robot's collisions and the model go by it; the tyres reach
        from one side to the other by the track and one tyre's width.""",
    ),
    "W-MOTOR-RATED": _code(
        "a motor faster than those of such robots",
        """
        `motor.rated` is the speed of the wheel, behind the gear, at full power. A number without a
        unit is in rad/s, while motors are sold in revolutions a minute: 100 rpm are 10.5 rad/s.
        Odometry and the speed loops expect ten times the speed when the unit is missing.""",
    ),
    "W-POLARITY": _code(
        "nobody has seen the wheels turn the right way",
        """
        A one-channel encoder counts alike in both directions. With a motor's wires exchanged the
        robot would drive backwards and believe to drive forwards. Until it is proven that each
        motor turns its own wheel the right way, a real robot is held to 0.1 m/s.

        `diffbotctl calibrate encoders` proves it; or set drive: {polarity: by_hand} when you have
        seen it yourself with the wheels in the air.""",
    ),
    "E-CODE": _code(
        "no such code",
        """
        Codes stand behind the place of each problem, such as E-PIN-PWM. `diffbotctl explain`
        without a code lists them all.""",
    ),
    "E-FLASH-BACKUP": _code(
        "the board's old program cannot be saved",
        """
        `--backup FILE` reads the program that is on the board, which takes half a minute, and
        writes it to an Intel hex file, from which `--hex FILE` brings it back. An existing file is
        never overwritten: it may be the only copy of what was there before.""",
    ),
    "E-EMULATOR": _code(
        "the emulated board cannot run",
        """
        The emulated board is a small program on simavr that runs the real firmware. It is built
        once on your machine, which takes a C compiler and simavr's headers; the simulated robot
        needs neither.""",
    ),
    "E-PORT-SILENT": _code(
        "nothing answers on this port",
        """
        The port opens, but nothing behind it says a word, at any of the baud rates that were tried:
        no power, a wrong port, crossed or loose wires, or a board that hangs. On a Mega 2560 the
        radio module's RX goes to pin 18 (TX1), its TX to pin 19 (RX1).""",
    ),
    "E-BOARD-KIND": _code(
        "no firmware for this kind of board",
        """
        Our firmware runs on a Mega 2560. Robots with other boards can be simulated, and driven with
        the book's firmware (link: {protocol: rosserial}) where their board has it.""",
    ),
    "E-BOARD-BLANK": _code(
        "the board has no program",
        """
        Only the bootloader answers, the small program that writes others. It was told to start
        what is on the board, and nothing started: `diffbotctl flash firmware` puts our program on
        it.""",
    ),
    "E-BOARD-ROSSERIAL": _code(
        "the board runs the book's firmware",
        """
        It speaks rosserial, and the robot file says link: {protocol: diffbot}. Either flash our
        firmware (the board can then stop by itself, and tells when each edge came), or drive the
        board as it is with a robot file that says link: {protocol: rosserial}.""",
    ),
    "E-BOARD-UNKNOWN": _code(
        "what answers cannot be understood",
        """
        Bytes come, but they are no frames of ours at any of the baud rates that were tried: another
        program on the board, or a radio module that was set to another rate than the board's port.
        Over the USB cable the rate is always right: try that first.""",
    ),
    "E-BOARD-VERSION": _code(
        "firmware of another version",
        """
        Board and host must speak the same version of the protocol, which each release of diffbotctl
        has one of. Flash the firmware that came with this diffbotctl, or install the diffbotctl
        that the firmware came with.""",
    ),
    "E-BOARD-SETTINGS": _code(
        "the board does not take the robot's settings",
        """
        Before it moves, the board is sent pins, gains and times of the robot file, and checks them
        by itself. It takes them at rest only, from the port that drives it. The cause says which
        one it refuses, and why.""",
    ),
    "E-PORT-BUSY": _code(
        "the serial port is in use",
        """
        Another program holds the port: a serial monitor, another diffbotctl, or ModemManager, which
        looks at each new port for some seconds. Two programs on one port garble each other.""",
    ),
    "E-PORT-RIGHTS": _code(
        "you may not use the serial port",
        """
        On most systems serial ports belong to the group dialout (uucp on Arch). Join it with
        `sudo usermod -aG dialout $USER`, then log out and in again. Never chmod 777.""",
    ),
    "E-PORT-SESSION": _code(
        "the group was joined, this session began before",
        """
        Groups are given out at login. Log out of the whole desktop session and in again, or
        restart; `newgrp dialout` gives one window the new group at once. `id` shows the groups in
        force.""",
    ),
    "E-PORT-RULE": _code(
        "the port belongs to nobody's group",
        """
        The device file is root's alone, or its group may not write. A udev rule gives it to the
        group dialout each time it is plugged in: `diffbotctl doctor --fix` prints the commands.
        Never chmod 777: it lasts until the cable is pulled, and lets anyone in.""",
    ),
    "E-PORT-RENAMED": _code(
        "the port has another name now",
        """
        Linux numbers USB ports in the order of their coming. A board that was unplugged while a
        program held its port comes back under the next number. The names under
        /dev/serial/by-id stay the same: use those.""",
    ),
    "E-PORT-CONSOLE": _code(
        "a login console runs on the port",
        """
        A Raspberry Pi offers a login on its serial pins until told otherwise, and would take what
        a board says for typing. raspi-config switches the login off and leaves the port on.""",
    ),
    "E-PORT-BRLTTY": _code(
        "brltty has taken the board's chip",
        """
        The CH340 and some others are found in Braille displays too, and brltty, which reads the
        screen to blind people, takes every one of them: the port appears and vanishes at once.
        Remove brltty if nobody here needs it.""",
    ),
    "E-PORT-DRIVER": _code(
        "no driver serves the board's chip",
        """
        The chip is seen on USB, but the kernel has loaded no driver for it. Mostly the kernel was
        updated and the machine not restarted since: the modules of the running one are gone.""",
    ),
    "E-PORT-DFU": _code(
        "the board's USB chip is in its own bootloader",
        """
        A Mega's USB port is made by a second small chip, which has a program and a bootloader of
        its own. Touching the six pins beside the USB socket while it is plugged in starts the
        latter, and the board has no port until the cable is plugged in anew.""",
    ),
    "W-PORT-BRLTTY": _code(
        "brltty may take the port",
        """
        Its rules name this board's chip. It works now, and may vanish the next time it is plugged
        in: remove brltty if nobody here needs a Braille display.""",
    ),
    "W-PORT-MODEM": _code(
        "ModemManager may talk to the board",
        """
        It looks for modems on ports that were just plugged in, and sends some of them AT commands
        for half a minute: flashing fails, and the bootloader is held up. A udev rule tells it to
        leave a board alone: `diffbotctl doctor --fix` prints it.""",
    ),
    "W-PORT-WORLD": _code(
        "anyone may write to the port",
        """
        Somebody has used chmod on it. That lasts until the cable is pulled, and meanwhile every
        program of every user can drive the motors. Join the group that owns it instead.""",
    ),
    "W-PORT-TWINS": _code(
        "two boards that cannot be told apart",
        """
        A CH340 has no serial number, so two boards with one get the same name under
        /dev/serial/by-id, and it leads to whichever came last. The names under
        /dev/serial/by-path tell the USB sockets apart.""",
    ),
    "W-PORT-SEVERAL": _code(
        "more than one port may be the board",
        """
        `--port auto` cannot choose. Name one with --port; the names under /dev/serial/by-id stay
        the same.""",
    ),
    "W-PORT-NONE": _code(
        "no board is plugged in",
        """
        No serial port looks like a board. Many USB cables only charge and have no data wires. A
        robot with a Bluetooth module needs no cable: --port bluetooth:ADDRESS.""",
    ),
    "W-PORT-BOARD": _code(
        "another kind of board",
        """
        Our firmware runs on a Mega 2560. Other boards can be driven with the book's firmware, by a
        robot file that says link: {protocol: rosserial}.""",
    ),
    "W-PORT-OTHER": _code(
        "the port leads to no board",
        """
        Modems and satellite receivers have serial ports too. Asking them confuses them: leave them
        alone.""",
    ),
    "E-BLUETOOTH-ADAPTER": _code(
        "no Bluetooth radio",
        """
        This machine has none, or its driver did not find it. A stick for a few euros does; drive
        over the USB cable meanwhile.""",
    ),
    "E-BLUETOOTH-BLOCKED": _code(
        "Bluetooth is switched off",
        """
        `rfkill list` shows what keeps it silent: a switch or key of the machine (hard), or a
        setting (soft), which `rfkill unblock bluetooth` undoes.""",
    ),
    "E-BLUETOOTH-SERVICE": _code(
        "the Bluetooth service cannot be asked",
        """
        Scanning and pairing are done by the system's service bluetoothd, from the package bluez,
        over the system's message bus. It must be installed and run: `systemctl status
        bluetooth`. Driving needs it only to have paired once.""",
    ),
    "E-BLUETOOTH-PYTHON": _code(
        "this Python cannot do Bluetooth",
        """
        Some builds of Python leave Bluetooth sockets out. The one that comes with the system has
        them: make the virtual environment with /usr/bin/python3 -m venv.""",
    ),
    "E-BLUETOOTH-LIBRARY": _code(
        "the package jeepney is missing",
        """
        `bluetooth scan` and `bluetooth pair` speak to the system's Bluetooth service with the
        package jeepney, which is installed with: pip install 'diffbotctl[bluetooth]'.""",
    ),
    "E-BLUETOOTH-ADDRESS": _code(
        "no Bluetooth address",
        """
        An address is six pairs of hexadecimal digits with colons, such as 98:D3:31:FC:12:34;
        `diffbotctl bluetooth scan` lists those in reach. A number of a channel may follow a
        slash; an HC-05 has only channel 1.""",
    ),
    "E-BLUETOOTH-ABSENT": _code(
        "the module was not found",
        """
        It does not answer: no power (its light does not blink), too far, or connected to another
        machine already, in which case its light blinks twice every two seconds. An HC-05 speaks
        to one host at a time.""",
    ),
    "E-BLUETOOTH-PAIR": _code(
        "pairing failed",
        """
        Host and module must agree on a number. An HC-05's is 1234 unless somebody changed it;
        some modules use 0000. A module that was paired anew elsewhere, or whose number changed,
        must first be forgotten here: `bluetoothctl remove ADDRESS`.""",
    ),
    "E-BLUETOOTH-CONNECT": _code(
        "no connection to the module",
        """
        The radio link could not be made. Refused: the module is connected elsewhere, or not
        paired. No answer: no power, or out of reach. An HC-05's light blinks fast while it waits
        for a connection, and twice every two seconds while it has one.""",
    ),
    "E-BLUETOOTH-AT": _code(
        "the module does not answer AT commands",
        """
        An HC-05 listens to AT commands only when its small button was held while its power came
        on; its light then blinks slowly, once in two seconds, and it listens at 38400 baud
        whatever rate it was set to. Its RX and TX must lead to the board as when driving.""",
    ),
    "E-PORT-KIND": _code(
        "that is no serial port",
        """
        The device exists but is not a serial port, or there is none of that name. `ls /dev/ttyUSB*
        /dev/ttyACM* /dev/rfcomm*` lists the usual ones.""",
    ),
    "E-PORT-BAUD": _code(
        "the port refuses the baud rate",
        """
        The adapter or its driver cannot do the baud rate of the robot file. 9600 and 115200 work
        everywhere.""",
    ),
    "E-PORT-OPEN": _code(
        "the serial port cannot be opened",
        """
        The device is not there, or it vanished: the cable was pulled, the Bluetooth module lost its
        pairing, or the name changed after a reconnect. `ls /dev/ttyUSB* /dev/ttyACM* /dev/rfcomm*`
        shows what there is now.""",
    ),
    "E-RECORD": _code(
        "the recording cannot be written or read",
        """
        The disk may be full, the folder may not exist, or the file is no recording of
        diffbotctl.""",
    ),
    "E-BOARD-SIMULATED": _code(
        "a robot of the simulator alone",
        """
        Its file says `board: {type: simulated}`: no board carries its wheels, so there is nothing
        that a port could lead to. Run it simulated, or name the robot that you have built.""",
    ),
    "E-BOARD-PIN": _code(
        "a pin that is missing",
        """
        `none` for a pin means that nothing is connected there. A motor without its three pins does
        not turn, and a wheel without its encoder is not known to turn. Only a robot that is
        simulated alone (`board: {type: simulated}`) does without.""",
    ),
    "E-BOARD-SENSOR": _code(
        "a sensor that no board reads",
        """
        Laser scanner and overhead camera exist in the simulator. No firmware of ours reads them
        yet, and of distance sensors at pins a board tells one, the first in the robot file. On a
        real board this sensor would stay silent, and whatever waits for it would hold the robot
        still.""",
    ),
    "W-BOARD-SENSOR": _code(
        "a second distance sensor",
        """
        Each frame of the board, and each range message of the book's firmware, has one distance:
        that of the first sensor in the robot file. Further ones exist in the simulator only. A run
        on a real port is refused where a block waits for one of them (E-BOARD-SENSOR).""",
    ),
    "W-UNGUARDED": _code(
        "nothing stops the robot at obstacles",
        """
        The pipeline has a block that stops the robot at what its sensor sees, but this robot has no
        such sensor, so the block was left out (`needs:` in the pipeline). It drives as it is told,
        into walls too.""",
    ),
    "E-OUTPUT": _code(
        "a file cannot be written",
        """
        The folder may not exist, the disk may be full, or you may not write there. Nothing else was
        changed. `ls -ld FOLDER` shows who may write into it.""",
    ),
    "E-LOG": _code(
        "the file of the log cannot be written",
        """
        `run --log FILE` adds to FILE. The folder may not exist, or the file belongs to someone
        else. The run has not started.""",
    ),
    "E-SOCKET": _code(
        "the control socket",
        """
        Other processes watch and command a run through a Unix socket that only its own user may
        open, or with `--group` the members of a group. It could not be made, or it does not obey
        whoever asked. `run --no-socket` does without one; then nobody can speak to that run.""",
    ),
    "E-NO-ENGINE": _code(
        "no such engine",
        """
        The command speaks to a running engine: one that `diffbotctl run` started, of your own user
        or of a group that you are in. With several, `--engine NAME` says which.""",
    ),
    "E-NO-ANSWER": _code(
        "the engine does not answer",
        """
        Its control socket is there, but nothing came from it in time: the process is stopped, the
        machine is overloaded, or the run has just ended. `diffbotctl stop` does not need the
        socket: it ends the engine by a signal.""",
    ),
    "E-PROTOCOL": _code(
        "a line that is not understood",
        """
        The control socket speaks JSON, one object a line, the first one a hello with the version.
        docs/protocol.md describes it, with a client of a few lines.""",
    ),
    "E-REQUEST": _code(
        "a request that cannot be followed",
        """
        The request was read, but something in it is missing, misspelt, of another kind or beyond
        the limits of the robot. Nothing of it was done.""",
    ),
    "E-BUSY": _code(
        "not now",
        """
        Someone else is driving, too many are connected, or more was asked for than the engine
        takes in a second. A stop is never refused for that.""",
    ),
    "E-SAVE": _code(
        "the parameters were not saved",
        """
        `param save` changes values of the pipeline file and leaves all else as it stands. It does
        not touch files that ship with diffbotctl, nor a layout that it might damage: with `--to`
        it writes a new file that includes the old one.""",
    ),
    "E-HELD": _code(
        "the robot is held",
        """
        A stop that waits for a person is in force: `diffbotctl why` tells what it was. When it is
        safe, `diffbotctl resume`.""",
    ),
    "operator_stop": _code(
        "a person asked to stop",
        """
        Someone stopped the robot by `diffbotctl stop` or through the control socket. It stands
        until `resume`; a goal that was under way then goes on.""",
    ),
    "operator_lost": _code(
        "whoever was driving is gone",
        """
        A person who drives says so many times a second. 300 ms without a word, or the end of the
        connection, and the robot stands: the terminal was closed, the radio failed, the laptop
        sleeps. When it is safe, `resume`.""",
    ),
    "obstacle": _code(
        "something stands ahead",
        """
        `obstacle_stop` slows the robot down so that it can always stop, and holds it when no
        room is left. Turning and backing away stay possible. It drives on when the way is
        clear, or waits for `resume`, as the pipeline says.""",
    ),
    "too_close": _code(
        "something is closer than the sensor can measure",
        """
        Below 4 cm a Sharp sensor's voltage falls again: 2 cm reads like 5.3 cm. So once something
        came that close, it is believed to be there until the voltage has come back through its
        peak. When you see that nothing is there, `resume` says so.""",
    ),
    "range_fault": _code(
        "the distance sensor is not to be believed",
        """
        It gives no voltage, zero volts for several readings, or exactly the same voltage for
        seconds, which a living sensor's noise makes impossible. Check its three wires: red 5 V,
        black ground, yellow or white to the analog pin.""",
    ),
    "range_stale": _code(
        "no fresh distance",
        """
        The last distance is too old to drive by. Usually the whole link is late; see the link's
        state. It ends by itself when distances come again.""",
    ),
    "telemetry_stale": _code(
        "no telemetry from the board",
        """
        Nothing came from the board for several frames. Noise on a radio link does that; so does a
        robot out of reach. It ends by itself when telemetry comes again soon, else the link counts
        as lost.""",
    ),
    "link_lost": _code(
        "the link to the board is gone",
        """
        The port was closed, or nothing came for a second. A board with our firmware stops its
        motors by itself. A stop is the first thing sent when the link is back; then `resume`.""",
    ),
    "reconnect": _code(
        "the link is back",
        """
        After a lost link the robot stands until a person has seen that it may move: `resume`.""",
    ),
    "board_restart": _code(
        "the board restarted while in use",
        """
        Its counts began anew. Usual reasons: the supply dips when both motors start (use separate
        batteries or a large capacitor), a loose wire, or the reset button.""",
    ),
    "command_stale": _code(
        "the pipeline gave no command",
        """
        A robot in motion needs a new command all the time. None came, so something in the pipeline
        does not react: look at its wires with `diffbotctl graph`.""",
    ),
    "gate_limit": _code(
        "a command beyond the robot's limits",
        """
        The last gate lets only commands pass that are finite and within the limits of the robot
        file. It does not trim them: a command beyond the limits means that a block is wrong.""",
    ),
}
