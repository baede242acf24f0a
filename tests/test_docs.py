"""What the documents show is true: code runs, files exist, commands are there."""

import doctest
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_the_block_in_the_overview_works():
    text = (ROOT / "docs" / "overview.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, re.S)[1]
    names = {"__name__": "shown"}
    exec(code, names)
    slow = names["Slow"](share=0.25)
    assert slow.react(1, names["Twist"](0, 0.4, 2.0)) == (1, 0.1, 0.5)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_python_is_shown_to_answer_it_answers(page):
    text = page.read_text()
    shown = [each for each in re.findall(r"```python\n(.*?)```", text, re.S) if ">>> " in each]
    test = doctest.DocTestParser().get_doctest("".join(shown), {}, page.name, str(page), 0)
    said = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=said.append)
    assert not said, "".join(said)
    assert page.name != "kinematics.md" or len(test.examples) > 40


def test_the_kinematics_picture_is_what_the_code_draws():
    from prove.arc_picture import PAGE, picture

    assert PAGE.read_text() == picture(), "run `python -m prove.arc_picture`"


def test_the_robot_that_is_shown_is_fine(tmp_path):
    from diffbotctl.config.load import load, load_robot

    text = (ROOT / "docs" / "robots.md").read_text()
    (shown,) = re.findall(r"```yaml\n(.*?)```", text, re.S)
    file = tmp_path / "mine.yaml"
    file.write_text(shown)
    assert load_robot(str(file)).warnings == ()
    assert load("goal", str(file)).robot.drive.left.encoder.slots == 24


def test_the_table_of_robots_is_true():
    from diffbotctl.config import resources
    from diffbotctl.config.load import load_robot

    text = (ROOT / "docs" / "robots.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) \|$", text, re.M))
    assert set(rows) == set(resources.names("robots"))
    for name, most in rows.items():
        limits = load_robot(name).robot.limits
        speed, rate = (float(part.split()[0]) for part in most.split(", "))
        assert (speed, rate) == (limits.speed, limits.turn_rate)


def test_links_resolve():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}, not there"


def test_files_named_in_the_overview_exist():
    text = (ROOT / "docs" / "overview.md").read_text()
    for name in re.findall(r"`((?:\w+/)+\w+\.py)`", text):
        inside = ROOT / "diffbotctl" / name
        assert inside.exists() or (ROOT / name).exists(), f"the overview names {name}: not there"


@pytest.mark.parametrize("page", ["README.md", "docs/kinematics.md", "docs/robots.md"])
def test_commands_that_are_shown_run(page):
    from click.testing import CliRunner

    from diffbotctl.cli.main import COMMANDS, program

    text = (ROOT / page).read_text()
    commands = re.findall(r"^    diffbotctl (.*?)(?:\s+#.*)?$", text, re.M)
    assert commands
    for line in commands:
        import shlex

        words = shlex.split(line)
        assert words[0] in COMMANDS
        if "--port" in words or words[0] == "emulate":
            continue  # tests/runs and tests/links run these, on boards behind pseudo-terminals
        if words[0] in ("drive", "goto", "call", "param", "topic", "stop"):
            continue  # tests/hub runs these, on an engine that is running
        if words[0] == "run" and "--fast" not in words:
            words += ["--fast"]
        if words[0] == "run":
            words += ["--quiet"]
        result = CliRunner().invoke(program, words, standalone_mode=False)
        assert result.exception is None, f"diffbotctl {line}: {result.exception!r}"


def test_the_reference_is_what_the_declarations_say():
    from diffbotctl.config import reference

    assert reference.PAGE.read_text() == reference.page(), (
        "docs/reference.md is out of date: run `python -m diffbotctl.config.reference`"
    )
