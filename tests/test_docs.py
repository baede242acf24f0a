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
    output = []
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=output.append)
    assert not output, "".join(output)
    assert page.name != "kinematics.md" or len(test.examples) > 40


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_and_commands_fit_a_terminal(page):
    """80 columns, so that they can be copied. What a program prints may be longer."""
    lines, is_code = [], False
    for line in page.read_text().splitlines():
        if line.startswith("```"):
            is_code = not is_code
        elif (is_code and not line.startswith("{")) or line.startswith("    diffbotctl "):
            lines.append(line)
    assert not [line for line in lines if len(line) > 80]


def test_the_kinematics_picture_is_what_the_code_draws():
    from tests.support.trials.arc_picture import PAGE, picture

    assert PAGE.read_text() == picture(), "run `python -m tests.support.trials.arc_picture`"


def test_the_robot_that_is_shown_is_fine(tmp_path):
    from diffbotctl.config.load import load, load_robot

    text = (ROOT / "docs" / "robots.md").read_text()
    shown, disturbed = re.findall(r"```yaml\n(.*?)```", text, re.S)
    file = tmp_path / "mine.yaml"
    file.write_text(shown)
    assert load_robot(str(file)).warnings == ()
    assert load("goal", str(file)).robot.drive.left.encoder.slots == 24
    file.write_text(f"format: 1\nkind: robot\ninclude: book_2wd\n{disturbed}")
    faults = load_robot(str(file)).robot.simulation.faults
    assert (faults[0].size, faults[1].at) == ((0.85, 0.85), (4.0, 6.0))


def test_the_table_of_robots_is_true():
    from diffbotctl.config import lookup
    from diffbotctl.config.load import load_robot

    text = (ROOT / "docs" / "robots.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) \|$", text, re.M))
    assert set(rows) == set(lookup.names("robots"))
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


def test_the_drawing_in_the_hardware_page_is_what_wiring_draws(tmp_path):
    from click.testing import CliRunner

    from diffbotctl.cli import wiring

    words = ["book_2wd", "--output", str(tmp_path / "wiring.svg")]
    assert CliRunner().invoke(wiring.wiring, words).exit_code == 0
    assert (tmp_path / "wiring.svg").read_text() == (ROOT / "docs/wiring.svg").read_text(), (
        "run `diffbotctl wiring book_2wd --output docs/wiring.svg`"
    )


def test_the_wires_in_the_hardware_page_are_those_of_the_book_s_robot():
    from diffbotctl.config.load import load_robot

    drive = load_robot("book_2wd").robot.drive
    text = (ROOT / "docs" / "hardware.md").read_text()
    for side, half in ((drive.left, "ENA, IN1, IN2"), (drive.right, "ENB, IN3, IN4")):
        motor = side.motor
        assert f"| Mega {motor.enable}, {motor.in1}, {motor.in2} | L298N {half} |" in text
    pins = f"{drive.left.encoder.pin} and {drive.right.encoder.pin}"
    assert f"| Mega {pins} | OUT of the left and right encoder |" in text


def test_codes_in_the_pages_are_explained():
    from diffbotctl.codes import code_texts

    for page in PAGES:
        for code in re.findall(r"\b[EW](?:-[A-Z]+)+\b", page.read_text()):
            assert code in code_texts(), f"{page.name} names {code}, which `explain` does not know"


def test_the_reference_is_what_the_declarations_say():
    from tests.support.reference import pages

    assert pages.PAGE.read_text() == pages.page(), (
        "docs/reference.md is out of date: run `python -m tests.support.reference.pages`"
    )


def test_every_target_is_run_by_ci_or_the_readme_states_that_it_is_not():
    rules = dict(re.findall(r"^([\w-]+):(.*)$", (ROOT / "Makefile").read_text(), re.M))
    ci, readme = (ROOT / ".ci" / "run").read_text(), (ROOT / "README.md").read_text()
    run = set(re.findall(r"timed make ([a-z]+)", ci))
    run |= {word for name in run for word in rules[name].split()}
    left_out = re.findall(r"`make\s+(\w+)`", re.search(r"It does not run ([^.]*)\.", readme)[1])
    targets = set(re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.M)[1].split())
    named = set(re.findall(r"`make\s+(\w+)`", readme))
    assert named <= targets and targets == run & targets | set(left_out)
    assert not run & set(left_out)
