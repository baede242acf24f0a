"""Recordings: read by others, cut by SIGKILL, mended; their cost; replays with a change."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from random import Random
from xml.etree import ElementTree

from jsonschema import Draft7Validator
from mcap.reader import make_reader

from diffbotctl.recording.reader import RecordingReader
from diffbotctl.recording.recover import recover
from prove import flight_load
from tests.support.command_process import children_of, command_line
from tests.support.trials.row import Row

# SHA-256 of the schemas of @foxglove/schemas 2.1.0, written with sorted keys by json.dumps.
PUBLISHED = {
    "foxglove.FrameTransform": "cec145253b0f1ca3e9415ab096eb8d17b5a331cd98aaa39cd930184349ff84ef",
    "foxglove.PoseInFrame": "8988b1b89d7350306accf887a32a28d9879ba543e15607b8c8096849dfcd2b09",
    "foxglove.LaserScan": "adaabd6e7b2beccce7d86b206bef823bf5161a2fcd49a62238d5e59c83474c64",
    "foxglove.Log": "3837e1e52d67502baf7b977c7602985ca65da64e2af5b114343f29554945dc54",
    "foxglove.SceneUpdate": "aa4199d1493bd87e7fba5f9a07ff27e5b1e8204e7cbac2058bfe4106445b5be7",
}
SCENE_PARTS = {"base_link", "left_wheel_link", "right_wheel_link", "walls", "goal", "trail"}
QUIET = {"operator.log.lines", "path"}  # have messages in some runs only
CORNERS = ("0.6 0", "0.6 0.6", "0 0.6", "0 0")
LOSS = 1.0  # s that a SIGKILL may cost
EARLIEST, LATEST = 1.0, 4.0  # s of driving before it comes
AT_ONCE = 2  # trials in parallel: more would starve the recorders that they measure
SHARE = 0.02  # of a core, for recording 50 frames a second
TICK = os.sysconf("SC_CLK_TCK")  # per second, in /proc/PID/stat


def rows(seed: int, trials: int, drive_s: float = 20.0, ring: float = 1.0) -> Iterator[Row]:
    """All rows. `trials` recordings are cut by SIGKILL; the cost is that of `drive_s` seconds.

    `ring`: the share of the black box that is full when it is written.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "goal.mcap"
        run("run", "goal", "--fast", "--quiet", "--seed", str(seed), "--record", str(path))
        yield from read_by_others(path)
        yield from shown_by_viewers(path)
        yield from killed(folder, Random(seed), trials)
        yield cost("recorder's process, 50 Hz board", folder, drive_s, ["--record", "on.mcap"])
        yield cost("flight recorder alone in its hub, 50 Hz board", folder, drive_s, [])
        yield flight_load.row(ring)
        yield changed(path)


def words(*command: str) -> list[str]:
    """The program as a command line."""
    return command_line(*command)


def run(*command: str) -> str:
    """What a command that must end well prints."""
    done = subprocess.run(words(*command), capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout}{done.stderr}")
    return done.stdout


def read_by_others(path: Path) -> Iterator[Row]:
    """The reference reader sees what ours does; schemas and messages are the published kind."""
    ours = sum(1 for _ in RecordingReader(path).records())
    theirs, bad, schemas = 0, 0, {}
    validators: dict[str, Draft7Validator] = {}
    with path.open("rb") as file:
        for schema, _, message in make_reader(file, validate_crcs=True).iter_messages():
            theirs += 1
            assert schema is not None
            if schema.name in PUBLISHED:
                text = json.loads(schema.data)
                schemas[schema.name] = sha256(json.dumps(text, sort_keys=True).encode()).hexdigest()
                validator = validators.setdefault(schema.name, Draft7Validator(text))
                bad += not validator.is_valid(json.loads(message.data))
    yield Row(
        "messages that the reference reader (mcap) reads",
        f"{theirs} of {ours}",
        "all",
        theirs == ours > 0,
    )
    equal = sum(schemas.get(name) == digest for name, digest in PUBLISHED.items())
    yield Row.counted("foxglove.* schemas in it equal to the published", equal, len(PUBLISHED))
    yield Row("viewers' messages against those schemas", f"{bad} invalid", "0", bad == 0)


def shown_by_viewers(path: Path) -> Iterator[Row]:
    """What the 3D panel draws, and whether model and layout fit to it."""
    drawn, frames, topics, files = set(), set(), set(), {}
    with path.open("rb") as file:
        reader = make_reader(file)
        for schema, channel, message in reader.iter_messages():
            topics.add(channel.topic)
            assert schema is not None
            if schema.name == "foxglove.SceneUpdate":
                drawn |= {each["id"] for each in json.loads(message.data)["entities"]}
            elif schema.name == "foxglove.FrameTransform":
                fields = json.loads(message.data)
                frames |= {fields["parent_frame_id"], fields["child_frame_id"]}
        for attachment in reader.iter_attachments():
            files[attachment.name] = attachment.data
    figure = f"{len(SCENE_PARTS & drawn)} of {len(SCENE_PARTS)}"
    yield Row(
        "outline, wheels, walls, goal, trail in the scene", figure, "all", drawn >= SCENE_PARTS
    )
    faults = list(_attachment_faults(files, frames, topics))
    for fault in faults:
        print(f"        {fault}")
    yield Row(
        "attached robot model and layout that fit to it", f"{len(faults)} faults", "0", not faults
    )


def _attachment_faults(
    files: dict[str, bytes], frames: set[str], topics: set[str]
) -> Iterator[str]:
    if files.keys() != {"robot.urdf", "layout.json"}:
        yield f"attached are {sorted(files)}"
        return
    links = {
        link.get("name", "") for link in ElementTree.fromstring(files["robot.urdf"]).iter("link")
    }
    if frames != links | {"odom"}:
        yield f"in one only: {sorted(frames ^ (links | {'odom'}))}"
    panels = json.loads(files["layout.json"])["configById"]
    named = {name for panel in panels.values() for name in panel.get("topics", {})}
    named |= {
        path["value"].split('"')[1] for panel in panels.values() for path in panel.get("paths", ())
    }
    named |= {panel["topicToRender"] for panel in panels.values() if "topicToRender" in panel}
    for name in sorted(named - topics - QUIET):
        yield f"the layout names {name}, which is not in the recording"


class Cut:
    """One paced, recorded run; engine and recorder are killed together at a random moment."""

    def __init__(self, path: Path, wait: float) -> None:
        process = subprocess.Popen(
            words(
                "run",
                "goal",
                "--goal",
                "9 0",
                "--set",
                "world.walls=[]",
                "--record",
                str(path),
                "--no-socket",
            ),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert process.stdout is not None
        for line in process.stdout:
            if "driving" in line:
                break
        time.sleep(wait)
        family = [*children_of(process.pid), process.pid]
        for pid in family:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        now = time.time_ns()
        process.wait()
        process.stdout.close()
        reader = RecordingReader(path)
        messages = [(item.time, item.wire, item.data) for item in reader.messages()]
        # The clock starts a little after the epoch in the file, so this is too much, if anything.
        last = max((time for time, *_ in messages), default=0)
        self.lost = (now - int(reader.about["epoch"]) - last) / 1e9
        self.whole = self._mended(path, messages)

    @staticmethod
    def _mended(path: Path, messages: list[tuple[int, str, bytes]]) -> bool:
        target = path.with_suffix(".mended.mcap")
        recover(path, target)
        with target.open("rb") as file:  # this reader refuses an unfinished file
            for _ in make_reader(file).iter_messages():
                pass
        again = RecordingReader(target).messages()
        return messages == [(item.time, item.wire, item.data) for item in again]


def killed(folder: Path, rng: Random, trials: int) -> Iterator[Row]:
    """What SIGKILL of engine and recorder costs, and what `recover` brings back."""
    waits = [(folder / f"{n}.mcap", rng.uniform(EARLIEST, LATEST)) for n in range(trials)]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        cuts = list(pool.map(lambda each: Cut(*each), waits))
    worst = max(cut.lost for cut in cuts)
    yield Row(
        f"lost by SIGKILL of engine and recorder (n={trials})",
        f"worst {worst:.2f} s",
        f"<= {LOSS:g} s",
        worst <= LOSS,
    )
    whole = sum(cut.whole for cut in cuts)
    yield Row.counted("recovered with every message that was flushed", whole, trials)


def cost(what: str, folder: Path, drive_s: float, more: list[str]) -> Row:
    """CPU time of the child that records, from its start, over a paced drive of a 50 Hz board."""
    more = [str(folder / word) if word.endswith(".mcap") else word for word in more]
    goals = [part for corner in CORNERS * 9 for part in ("--goal", corner)]
    process = subprocess.Popen(
        words(
            "run",
            "goal",
            "--robot",
            "book_2wd_counts",
            "--set",
            "world.walls=[]",
            "--quiet",
            "--no-socket",
            "--for",
            f"{drive_s + 5:g}s",
            *goals,
            *more,
        ),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "XDG_STATE_HOME": str(folder)},
    )
    time.sleep(drive_s)
    (recorder,) = children_of(process.pid)
    fields = Path(f"/proc/{recorder}/stat").read_text().rpartition(")")[2].split()
    used = (int(fields[11]) + int(fields[12])) / TICK  # utime and stime
    process.terminate()
    process.wait()
    share = used / drive_s
    return Row(what, f"{share:.2%} of a core", f"<= {SHARE:.0%}", share <= SHARE)


def changed(path: Path) -> Row:
    """One parameter changed, twice: the same run, with the metrics of both beside each other."""
    command = ("replay", str(path), "--set", "robot.limits.speed=0.15 m/s")
    one, other = run(*command), run(*command)
    names = ("time to goal", "cross track max", "cross track rms", "stops", "true error")
    reported = sum(bool(re.search(rf"^{name} .*\d", one, re.M)) for name in names)
    before = run("replay", str(path))
    digests = [re.search(r"digest (\w+)", text) for text in (one, other, before)]
    first, again, plain = (found[1] if found else None for found in digests)
    met = one == other and first == again != plain and reported == len(names)
    figure = f"{'same' if one == other else 'DIFFERENT'}, {reported} metrics"
    return Row("replayed twice with one parameter changed", figure, "same, 5 metrics", met)
