"""Trials: equal results whatever runs them, what they print, and what they refuse."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from diffbotctl.block import Block, In, Out
from diffbotctl.cli.main import program
from diffbotctl.errors import UserError
from diffbotctl.messages import Twist
from diffbotctl.trials.comparison import other_plan
from diffbotctl.trials.plan import read_plan
from diffbotctl.trials.report import html
from diffbotctl.trials.summary import junit
from diffbotctl.trials.verdict import judge
from diffbotctl.trials.workers import run_trials

TWO_CASES = """
format: 1
kind: trials
pipeline: goal
set: [robot.drive.polarity=checked_by_hand]
goals: [{x: 0.2 m}]
seeds: 2
time_limit: 8 s
expect: {reach: 8 s, error: 30 mm}
cases:
  healthy: {}
  blocked: {faults: [{fault: wheel_blocked, at: [0.2 s, 0.4 s], side: either}]}
"""


def trials_file(folder, text=TWO_CASES, **changes):
    for old, new in changes.items():
        text = text.replace(f"{old}:", new, 1) if ":" in new else text
    path = folder / "two.yaml"
    path.write_text(text)
    return path


def command(*words, **environment):
    line = [sys.executable, "-m", "diffbotctl", "trials", *map(str, words)]
    return subprocess.run(
        line, capture_output=True, text=True, env={**os.environ, **environment}, check=False
    )


def test_results_are_equal_with_any_number_of_workers_and_other_hash_seeds(tmp_path):
    file = trials_file(tmp_path)
    runs = [
        command(file, "--json", "--workers", workers, PYTHONHASHSEED=str(seed))
        for workers, seed in ((1, 0), (2, 1), (7, 2))
    ]
    assert {done.returncode for done in runs} == {1}
    assert len({done.stdout for done in runs}) == 1
    records = [json.loads(line) for line in runs[0].stdout.splitlines()]
    assert [record["run"] for record in records] == [
        "healthy/book_2wd/1/0",
        "healthy/book_2wd/1/1",
        "blocked/book_2wd/1/0",
        "blocked/book_2wd/1/1",
    ]
    assert [record["passed"] for record in records] == [True, True, False, False]
    assert all(0.2 <= record["fault_at"] <= 0.4 for record in records[2:])
    assert records[2]["path"] != records[3]["path"]


def test_a_failed_run_shows_its_seed_and_the_command_that_shows_it(tmp_path):
    file, junit = trials_file(tmp_path), tmp_path / "found.xml"
    done = command(file, "--only", "blocked/*/1", "--junit", junit)
    assert done.returncode == 1
    assert "FAILED blocked/book_2wd/1/1 (seed 1): not reached" in done.stdout
    assert f"diffbotctl trials {file} --only blocked/book_2wd/1/1 --watch" in done.stdout
    assert "0 of 1 runs as expected" in done.stdout
    (suite,) = ElementTree.parse(junit).getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("1", "1", "0")
    assert "not reached" in suite.find("testcase/failure").get("message")


def test_the_report_is_written_though_nobody_reads_what_is_printed(tmp_path):
    report = tmp_path / "found.html"
    words = [trials_file(tmp_path), "--only", "blocked/*/1", "--report", report]
    read, write = os.pipe()
    os.close(read)
    line = [sys.executable, "-m", "diffbotctl", "trials", *map(str, words)]
    subprocess.run(line, stdout=write, stderr=subprocess.DEVNULL, check=False)
    os.close(write)
    assert "0 of 1 runs as expected" in report.read_text()


class Endless(Block):
    """Does not return, ends its process, or raises; prints."""

    twist, requested = Out(Twist), In(Twist)
    what = ""

    def react(self, now, requested):
        print("nobody reads this")
        if now > 100_000_000:
            if self.what == "exit":
                os._exit(3)
            while self.what == "endless":
                pass
            raise ValueError("broken")
        return requested


class Exiting(Endless):
    """Ends its process."""

    what = "exit"


class Raising(Endless):
    """Raises texts that neither UTF-8 nor XML can have."""

    def react(self, now, requested):
        raise ValueError("bad \ud800 \x01 \x1b[31m \uffff")


class Looping(Endless):
    """Does not return."""

    what = "endless"


def with_block(trial, kind):
    """The trial with another block in place of the one that limits the acceleration."""
    blocks = []
    for use in trial.configuration.blocks:
        if use.name == "limiter":
            wires = {"requested": use.wires["twist"]}
            use = replace(use, cls=kind, values={}, wires=wires)
        blocks.append(use)
    return trial._replace(configuration=replace(trial.configuration, blocks=tuple(blocks)))


def test_a_run_that_crashes_or_does_not_end_is_a_result_and_the_others_go_on(tmp_path, capfd):
    (trial, *_) = read_plan(str(trials_file(tmp_path))).trials
    chosen = [with_block(trial, kind) for kind in (Endless, Exiting, Looping)] + [trial]
    began = time.monotonic()
    outcomes = run_trials(chosen, 2, 1.0, lambda number, outcome: None)
    assert time.monotonic() - began < 120.0  # s; the limit of those that use no processor time
    raised, ended, looped, healthy = [judge(each.result, trial.expect) for each in outcomes]
    assert "it raised ValueError: broken" in raised.unmet[0]
    assert "exit code 3" in ended.unmet[0] and ended.result.outcome == "crashed"
    assert "more than 1 s of processor time" in looped.unmet[0]
    assert healthy.passed
    assert capfd.readouterr().out == ""


def test_the_text_of_what_a_run_raised_can_be_written_to_every_file(tmp_path):
    plan = read_plan(str(trials_file(tmp_path)))
    (trial, *_) = plan.trials
    (outcome,) = run_trials([with_block(trial, Raising)], 1, 5.0, lambda number, outcome: None)
    judged = judge(outcome.result, trial.expect)
    (case,) = ElementTree.fromstring(junit("two", [judged]).encode()).iter("testcase")
    message = case[0].get("message")
    assert "bad \u00b7 \u00b7 \u00b7[31m \u00b7" in message
    assert message.split("; ")[0] in html(plan, [judged], 1.0).encode().decode()


@pytest.mark.parametrize(
    ("old", "new", "code", "part"),
    [
        ("seeds: 2", "seeds: none", "E-TYPE", "not a whole number"),
        ("wheel_blocked", "wheel_blockd", "E-CHOICE", "did you mean wheel_blocked?"),
        ("fault: wheel_blocked", "fault: stop_button", "E-FAULT", "no stop button is connected"),
        ("{x: 0.2 m}", "{x: 2.5 m}", "E-GOAL-WALL", "move the goal or the wall"),
        ("pipeline: goal", "pipeline: goal\nport: /dev/ttyUSB0", "E-CHOICE", "port cannot be"),
        ("pipeline: goal", "pipeline: hello", "E-TRIALS", "does not have one robot"),
        (
            "pipeline: goal",
            "pipeline: ./seeing.yaml",
            "E-TRIALS",
            "the devices stick at real ports",
        ),
        ("pipeline: goal", "pipeline: goalie", "E-FILE-NAME", "did you mean goal?"),
        ("8 s, error", "8 kg, error", "E-UNIT", "kg"),
        ("8 s, error", "8 s, clearance: 1.5 m, error", "E-BOUNDS", "1 m"),
        ("kind: trials", "kind: trails", "E-KIND", "write `kind: trials`"),
        ("pipeline: goal", "pipeline: ./two.yaml", "E-KIND", "this is a file of trials, but a"),
        ("  healthy:", "  'a/b*':", "E-NAME", "leave out /"),
        ("  healthy:", "  '':", "E-NAME", "begin it with a letter"),
        ("seeds: 2", "seeds: 60000", "E-TRIALS", "120,000 runs; at most 100,000"),
    ],
)
def test_a_mistake_is_shown_where_it_is_and_nothing_runs(tmp_path, old, new, code, part):
    (tmp_path / "seeing.yaml").write_text(
        "format: 1\nkind: pipeline\ninclude: goal\nsources: {stick: {driver: joystick}}\n"
    )
    file = trials_file(tmp_path, TWO_CASES.replace(old, new))
    with pytest.raises(UserError) as caught:
        read_plan(str(file))
    assert code in {problem.code for problem in caught.value.problems}
    assert part in " ".join(str(caught.value).replace("|", " ").split())


WANDER = "format: 1\nkind: trials\npipeline: wander\nseeds: 1\ntime_limit: 2 s\n"
HEADED = "cases: {a: {expect: {heading_error: 5 deg}}}\npipeline: goal\n"


@pytest.mark.parametrize(
    ("text", "keys", "part"),
    [
        (
            WANDER + "expect: {error: 1 mm, heading_error: 1 deg, farther: 1 mm}\n",
            ["error", "heading_error", "farther"],
            "cannot be judged: the runs have no goal",
        ),
        (WANDER + "expect: {error: 1 mm}\ncases: {a: {expect: {time: 3 s}}}\n", [], ""),
        (WANDER + "expect: {error: none, time: 3 s}\n", [], ""),
        (
            TWO_CASES.replace("pipeline: goal\n", "").partition("cases:")[0] + HEADED,
            ["heading_error"],
            "cannot be judged: a goal has no heading",
        ),
        (
            TWO_CASES.replace("pipeline: goal\n", "")
            .partition("cases:")[0]
            .replace("0.2 m", "0.2 m, heading: 0 deg")
            + HEADED,
            [],
            "",
        ),
    ],
)
def test_what_cannot_be_judged_is_refused_where_it_is_expected(tmp_path, text, keys, part):
    file = trials_file(tmp_path, text)
    problems = []
    try:
        read_plan(str(file))
    except UserError as error:
        problems = [each for each in error.problems if each.code == "E-TRIALS"]
    assert [each.cause.split()[0] for each in problems] == keys
    assert all(part in each.cause and each.fix.endswith("out") for each in problems)
    lines = file.read_text().splitlines()
    assert all(each.cause.split()[0] in lines[each.place.line - 1] for each in problems)


def test_a_run_without_a_goal_has_no_distance_from_it(tmp_path):
    done = command(trials_file(tmp_path, WANDER), "--json")
    (record,) = map(json.loads, done.stdout.splitlines())
    assert record["farther"] is None and record["error"] is None


def test_a_mistake_of_several_robots_is_reported_once(tmp_path):
    text = TWO_CASES.replace("wheel_blocked", "imu_biased")
    text = text.replace("pipeline: goal", "pipeline: goal\nrandom_robots: {count: 2}")
    with pytest.raises(UserError) as caught:
        read_plan(str(trials_file(tmp_path, text)))
    (problem,) = [each for each in caught.value.problems if "has no IMU" in each.cause]
    assert problem.fix == "add `imu: {type: mpu6050}`"


def test_robots_are_drawn_within_what_check_accepts(tmp_path):
    text = TWO_CASES.replace("seeds: 2", "seeds: 1\nrandom_robots: {count: 3}")
    trials = read_plan(str(trials_file(tmp_path, text))).trials
    robots = {trial.robot: trial.configuration.robot for trial in trials}
    assert len(trials) == 6 and len(robots) == 3
    assert len({robot.drive.track for robot in robots.values()}) == 3
    again = read_plan(str(trials_file(tmp_path, text))).trials
    assert [trial.name for trial in again] == [trial.name for trial in trials]
    done = command(trials_file(tmp_path, text), "--only", "healthy", "--json")
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == 3 and all(run["time"] > 0.5 for run in found)
    assert "crashed" not in {run["outcome"] for run in found}


def test_many_trials_are_not_begun_without_a_consent(tmp_path):
    file = trials_file(tmp_path, TWO_CASES.replace("seeds: 2", "seeds: 5000"))
    done = command(file, "--only", "*")
    assert done.returncode == 2
    assert "10000 runs take about" in done.stderr and "--yes" in done.stderr


def test_the_file_that_new_writes_is_fine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    program.main(["new", "trials", "first"], standalone_mode=False)
    assert len(read_plan("first").trials) == 30
    assert program.main(["check"], standalone_mode=False) == 0
    assert Path("schemas/trials.schema.json").is_file()


EMULATED = """
format: 1
kind: trials
pipeline: goal
port: emulated
goals: [{x: 0.2 m}]
seeds: 1
cases:
  healthy: {expect: {reach: 8 s, error: 30 mm}}
  board_reset:
    faults: [{fault: board_reset, at: 0.6 s}]
    expect: {stop: {code: board_restart, within: 1 s}}
  link_cut:
    faults: [{fault: link_cut, at: 0.6 s}]
    expect: {stop: {code: link_lost, within: 1 s}}
  link_loss:
    faults: [{fault: link_loss, at: 0.6 s, size: 0.9}]
    expect: {stop: {code: link_lost, within: 3 s}}
  link_delay:
    faults: [{fault: link_delay, at: 0.3 s, for: 0.4 s, size: 0.1 s}]
    expect: {reach: 8 s, error: 30 mm, unsure: allowed}
"""


def test_faults_of_the_board_and_its_link_act_on_the_emulated_board(tmp_path):
    done = command(trials_file(tmp_path, EMULATED))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "5 of 5 runs as expected" in done.stdout


def test_a_change_that_makes_it_worse_fails_against_what_was_before(tmp_path):
    file = trials_file(tmp_path, TWO_CASES.replace("seeds: 2", "seeds: 6"))
    before = command(file, "--only", "healthy", "--json")  # the name of a case
    base = tmp_path / "base.json"
    base.write_text(before.stdout)
    done = command(file, "--only", "healthy/*", "--against", base)
    assert done.returncode == 0 and "6 pairs with equal seeds" in done.stdout
    slower = "robot.limits.speed=0.05 m/s"
    worse = command(file, "--only", "healthy/*", "--set", slower, "--against", base)
    assert worse.returncode == 1 and "REGRESSION" in worse.stdout
    paired = command(file, "--only", "healthy/*", "--against", slower)
    assert f"against {slower}, 6 pairs with equal seeds" in paired.stdout


def test_a_baseline_of_other_runs_is_refused_before_any_run(tmp_path):
    base = tmp_path / "base.json"
    base.write_text(command(trials_file(tmp_path), "--only", "blocked/*", "--json").stdout)
    done = command(trials_file(tmp_path), "--only", "healthy/*", "--against", base)
    assert done.returncode == 2 and "it has none of these runs" in done.stderr
    assert done.stdout == ""
    record = command(trials_file(tmp_path), "--json", "--against", base).stdout.splitlines()[-1]
    assert json.loads(record)["pairs"] == 2 and json.loads(record)["unpaired"] == [0, 2]


def test_one_of_several_robots_is_compared_with_another(tmp_path):
    text = TWO_CASES.replace("seeds: 2", "seeds: 2\nrobots: [book_2wd, turtlebot3_burger]")
    file = trials_file(tmp_path, text)
    done = command(file, "--against", "book_2wd")
    assert done.returncode == 2 and done.stdout == ""
    assert "one robot is compared with one" in done.stderr and "*/book_2wd/*" in done.stderr
    plan, places = read_plan(str(file)).only(["*/turtlebot3_burger/*"])
    partners = other_plan(str(file), "book_2wd", ()).partners(plan, places)
    names = [trial.name.replace("turtlebot3_burger", "book_2wd") for trial in plan.trials]
    assert [trial.name for trial in partners.trials] == names and len(names) == 4
    setting = other_plan(str(file), "follower.tolerance=20 mm", ()).partners(plan, places)
    assert [trial.name for trial in setting.trials] == [trial.name for trial in plan.trials]


LEAD = """
import json, sys
for line in sys.stdin:
    print(json.dumps({"lead": {"linear": 0.1, "angular": 0.0}}), flush=True)
"""
LED = f"""
format: 1
kind: pipeline
include: goal
goals: []
programs:
  nose: {{run: {sys.executable} lead.py, in: {{range: range.range}}, out: {{lead: Twist}}}}
blocks: {{mux: {{in: {{autonomous: nose.lead}}}}}}
"""
OF_PROGRAMS = """
format: 1
kind: trials
pipeline: ./led.yaml
set: [robot.drive.polarity=checked_by_hand]
seeds: 1
time_limit: 6 s
expect: {stop: {code: input_stale, within: 2 s}}
cases:
  crash: {faults: [{fault: program_crash, at: 2 s}]}
  hang: {faults: [{fault: program_hang, at: 2 s, for: 1 s, program: nose}]}
  flood: {faults: [{fault: program_flood, at: 2 s}]}
"""


def test_faults_of_programs_act_in_real_time_on_the_process(tmp_path):
    (tmp_path / "lead.py").write_text(LEAD)
    (tmp_path / "led.yaml").write_text(LED)
    file = trials_file(tmp_path, OF_PROGRAMS)
    refused = command(file, XDG_STATE_HOME=str(tmp_path))
    assert refused.returncode == 2 and "E-PROGRAM-CONSENT" in refused.stderr
    done = command(file, "--allow-programs", "--json", "--workers", "3")
    causes = [json.loads(line)["cause"].partition(")")[2] for line in done.stdout.splitlines()]
    crash, hang, flood = causes
    assert "was ended by SIGKILL" in crash and "1000 lines" in flood
    assert "has published nothing on nose.lead" in hang
    assert done.returncode == 0


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("program: nose", "program: nase", "the pipeline has no program nase"),
        ("./led.yaml", "goal", "it starts no program"),
        ("program_flood", "wheel_blocked, program: nose", "not of a program"),
    ],
)
def test_a_fault_of_a_program_that_is_not_there_is_refused(tmp_path, old, new, part):
    (tmp_path / "lead.py").write_text(LEAD)
    (tmp_path / "led.yaml").write_text(LED)
    file = trials_file(tmp_path, OF_PROGRAMS.replace(old, new))
    with pytest.raises(UserError) as caught:
        read_plan(str(file))
    assert part in " ".join(str(caught.value).replace("|", " ").split())


def test_runs_that_prove_nothing_are_named(tmp_path):
    late = (
        "  late: {faults: [{fault: battery_step, at: 0.1 s, size: 0.95}, "
        "{fault: battery_cut, at: 100 s}, {fault: link_cut, at: [90 s, 100 s]}]}\n"
    )
    text = TWO_CASES.replace("seeds: 2", "seeds: 1").partition("  blocked")[0] + late
    done = command(trials_file(tmp_path, text))
    for kind in ("battery_cut", "link_cut"):
        assert f"late: 1 ended before {kind} began" in done.stdout
    assert done.stdout.count("ended before") == 2
    assert "nothing is expected" not in done.stdout
    text = text.replace("expect: {reach: 8 s, error: 30 mm}", "")
    done = command(trials_file(tmp_path, text), "--only", "healthy")
    assert "nothing is expected of them" in done.stdout and done.returncode == 0
