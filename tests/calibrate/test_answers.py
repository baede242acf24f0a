"""Answers files: which entry answers, and the error when none can."""

import pytest

from diffbotctl.calibrate.step import ManualAction
from diffbotctl.errors import RunError, UsageError
from diffbotctl.prompts.answers_file import AnswersFile
from diffbotctl.prompts.question import AnswerError, ExpectedQuestion, Question

READING = Question("distance.reading", "How far?", "m", "mm", 0.5, 2.0, quantity="distance")
FACING = Question("geometry.facing", "How far round?", "rad", "deg", quantity="facing")
LEFT = Question("geometry.left", "How far left?", "m", "mm", quantity="left")


class Fixed:
    """Instruments that show what they are set to."""

    def __init__(self, value):
        self.value, self.asked, self.rolled = value, [], []

    def mark(self):
        self.asked.append("mark")

    def read(self, instrument, question, noise):
        self.asked.append((instrument, question.name, noise))
        return self.value

    def refuse_instrument(self, instrument, question):
        if instrument == "ruler":
            raise AnswerError("the ruler cannot measure this")

    def roll(self, wheel, turns):
        self.rolled.append((wheel, turns))


@pytest.fixture
def file(tmp_path):
    def write(text, instruments=None):
        path = tmp_path / "answers.yaml"
        path.write_text(text)
        return AnswersFile(path, instruments)

    return write


def test_a_list_holds_one_answer_a_repeat(file):
    made = file("distance.reading: [998 mm, 1.003 m, 1001]")
    assert [made.answer(READING) for _ in range(3)] == pytest.approx([0.998, 1.003, 1.001])
    with pytest.raises(RunError, match="asked 4 times, but has 3 answers"):
        made.answer(READING)


def test_the_longest_name_answers(file):
    instruments = Fixed(0.25)
    text = "geometry: {measure: tape, noise: 1 mm}\ngeometry.facing: -3\n"
    made = file(text, instruments)
    assert made.answer(LEFT) == 0.25
    assert made.answer(FACING) == pytest.approx(-0.05236, abs=1e-5)  # 3 degrees
    assert instruments.asked == [("tape", "geometry.left", 0.001)]


def test_a_default_needs_no_entry(file):
    asked = Question("geometry.swapped", "?", choices=("yes", "no"), default="yes")
    assert file("{}").answer(asked) == "yes"


def test_a_wheel_turned_by_the_user(file):
    instruments = Fixed(0)
    file("{}", instruments).act(ManualAction("encoders.left_turns", "turn it", ("left", 10.0)))
    assert instruments.rolled == [("left", 10.0)]


@pytest.mark.parametrize(
    "text, instruments, words",
    [
        ("{}", None, "distance.reading: is not answered in this file"),
        ("distance.reading: 12 kg", None, "kg is a mass"),
        ("distance.reading: 12 mm", None, "not between 500 mm and 2000 mm"),
        ("distance.reading: {measure: tape}", None, "only a simulated robot can be measured"),
        ("distance.reading: {with: tape}", Fixed(1), "measure: tape, noise: 1 mm"),
        ("distance.reading: {measure: tape, noise: 1 deg}", Fixed(1), "noise: deg is an angle"),
    ],
)
def test_what_cannot_answer_reports_why(file, text, instruments, words):
    with pytest.raises(RunError) as raised:
        file(text, instruments).answer(READING)
    assert words in " ".join(str(raised.value).split())


def test_a_hand_is_missing_for_a_real_robot(file):
    with pytest.raises(RunError, match="needs a person"):
        file("{}").act(ManualAction("encoders.left_turns", "turn it", ("left", 10.0)))


SWAPPED = Question("geometry.swapped", "Which?", choices=("left", "none"))
LIFT = ManualAction("imu.lift_front", "Lift it.", lift=("front", 0.4))
ASKED = [
    ExpectedQuestion(READING, 5),
    ExpectedQuestion(LEFT, 2),
    ExpectedQuestion(FACING, 0),
    ExpectedQuestion(SWAPPED, 0),
    ExpectedQuestion(Question("range.distance", "How far?", "m", default="10 cm")),
]
NAMES = ["distance.reading", "geometry.facing", "geometry.left", "geometry.swapped", "imu.facing"]
WHOLE = "distance.reading: [998, 1001, 999, 1000, 1002]\ngeometry.left: [3, -4]\n"


@pytest.mark.parametrize(
    "text, words",
    [
        (WHOLE, []),
        (WHOLE + "imu: {measure: protractor}\n", []),  # of a step that does not run
        ("distance.reading: 1 m\ngeometry: {measure: tape, noise: 2 mm}\n", []),
        (WHOLE + "distance.readin: 3\n", ["distance.readin: no question has this name; did you"]),
        ("distance.reading: 998\n", ["geometry.left: is not answered in this file: How far left?"]),
        (WHOLE + "geometry.swapped: right\n", ["geometry.swapped: 'right' is not valid"]),
        (
            "distance.reading: [998, 12 kg]\ngeometry.left: 3\n",
            ["kg is a mass", "distance.reading: it will be asked 5 times, but has 2 answers"],
        ),
        ("distance.reading: 998 cm\ngeometry.left: 3\n", ["not between 500 mm and 2000 mm"]),
        (
            "distance.reading: 1 m\ngeometry.left: {measure: tape, noise: 1 V}\n",
            ["geometry.left: noise: V is a voltage"],
        ),
        (
            "distance.reading: {measure: ruler}\ngeometry.left: {with: tape}\n",
            ["distance.reading: the ruler cannot", "geometry.left: a measured answer looks like"],
        ),
    ],
)
def test_a_file_is_compared_with_the_questions_before_anything_moves(file, text, words):
    made = file(text, Fixed(0.0))
    if not words:
        made.check(ASKED, NAMES)
        return
    with pytest.raises(RunError) as raised:
        made.check(ASKED, NAMES)
    reported = [" ".join(problem.cause.split()) for problem in raised.value.problems]
    assert len(reported) == len(words)
    for cause, part in zip(reported, words, strict=True):
        assert part in cause


def test_a_real_robot_needs_a_person_and_a_tape_which_is_stated_first(file):
    made = file("distance.reading: {measure: tape}\ngeometry.left: 3\n")
    with pytest.raises(RunError) as raised:
        made.check([*ASKED, ExpectedQuestion(LIFT)], NAMES)
    causes = [problem.cause for problem in raised.value.problems]
    assert causes == [
        "imu.lift_front: needs a person: Lift it.",
        "distance.reading: only a simulated robot can be measured automatically",
    ]


@pytest.mark.parametrize("text", ["- 1\n", "a: [", "", "1: 2"])
def test_a_file_that_is_none_is_refused(file, text):
    if text == "1: 2":  # a number is as good a name as any; it answers nothing
        assert file(text).answers == {"1": "2"}
        return
    with pytest.raises(UsageError, match="E-CALIBRATE-ANSWER"):
        file(text)
