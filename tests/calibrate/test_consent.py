"""Nothing moves a robot before the consent that names this motion."""

from itertools import pairwise

import pytest

from diffbotctl.calibrate.runner import make_step, open_session, question_names, run_step
from diffbotctl.config.load import load_robot
from diffbotctl.errors import RunError
from diffbotctl.prompts.answers_file import AnswersFile
from tests.support.calibration_robots import SilentScreen

ROBOT = "format: 1\nkind: robot\ninclude: book_2wd\nimu: {type: mpu6050}\n"
LIFTED = ("encoders", "motors")
FLOOR = ("distance", "squares", "spin", "straight", "imu")


def step(name):
    is_geometry = name in ("squares", "spin", "straight")
    return make_step("geometry", how=name) if is_geometry else make_step(name)


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text(ROBOT)
    return load_robot(str(path))


@pytest.fixture
def answers(tmp_path):
    """An answers file as for a real robot: without tools."""

    def write(text):
        path = tmp_path / "answers.yaml"
        path.write_text(text)
        return AnswersFile(path)

    return write


@pytest.mark.parametrize("name", [*LIFTED, *FLOOR])
@pytest.mark.parametrize("entry", ["{}", "{STEP}: yes", "{STEP}.motion: no", "other.motion: yes"])
def test_an_answers_file_consents_only_by_the_name_of_the_motion(robot, answers, name, entry):
    made = step(name)
    session, tools = open_session(robot, "sim")
    with session, pytest.raises(RunError, match=f"{made.name}.motion"):
        run_step(made, session, answers(entry.replace("{STEP}", made.name)), SilentScreen())
    assert tools.truth.travel == 0.0


@pytest.mark.parametrize("name", FLOOR)
def test_a_drive_before_which_a_person_has_to_act_is_not_made_without_one(robot, answers, name):
    made = step(name)
    file = answers(f"{made.name}.motion: yes\n")
    with pytest.raises(RunError, match=f"{made.name}.start: needs a person: Put the robot at its"):
        file.check(made.questions(robot.robot), question_names(robot.robot))
    if name == "imu":
        return  # it turns once, as announced, before the floor is marked
    session, tools = open_session(robot, "sim")
    with session, pytest.raises(RunError, match="needs a person"):
        run_step(made, session, file, SilentScreen())
    assert tools.truth.travel == 0.0


@pytest.mark.parametrize("name", [*LIFTED, *FLOOR])
def test_a_missing_consent_is_named_before_anything_moves(robot, answers, name):
    made = step(name)
    with pytest.raises(RunError, match=f"{made.name}.motion: is not answered in this file"):
        answers("{}").check(made.questions(robot.robot), question_names(robot.robot))


class Person(AnswersFile):
    """A person who puts the robot back before each drive, and notes how far it has travelled."""

    def __init__(self, path, tools):
        super().__init__(path, tools)
        self.marks = []

    def mark_floor(self, mark):
        self.marks.append((mark.motion, self.tools.truth.travel))
        super().mark_floor(mark)


@pytest.mark.parametrize(
    ("name", "settings", "motion"),
    [
        ("distance", {"metres": 0.3, "repeats": 3}, "it drives 0.3 m straight ahead"),
        ("spin", {"turns": 1, "repeats": 1}, "it turns 1 times to the left, on the spot"),
    ],
)
def test_each_drive_is_waited_for_and_named(robot, tmp_path, name, settings, motion):
    how = {"how": name} if name == "spin" else {}
    made = make_step("geometry" if how else name, **how, **settings)
    path = tmp_path / "answers.yaml"
    path.write_text("distance: {measure: tape}\ngeometry: {measure: protractor}\n")
    session, tools = open_session(robot, "sim")
    person = Person(path, tools)
    with session:
        run_step(made, session, person, SilentScreen())
    assert person.marks[0] == (motion, 0.0)
    travelled = [travel for _, travel in person.marks] + [tools.truth.travel]
    drives = [after - before for before, after in pairwise(travelled)]
    assert len(drives) == settings["repeats"] * (2 if how else 1)
    assert min(drives) > 0.0 and max(drives) < 1.2 * min(drives)
