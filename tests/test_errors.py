"""How a problem looks on a terminal."""

import pytest

from diffbotctl.errors import (
    ConfigurationError,
    Place,
    Problem,
    Source,
    UsageError,
    closest_match,
    escape_control,
    join_words,
)


def rendered(line, column, length=1, cause="it is wrong", fix="mend it", number=17, width=80):
    source = Source("robots/mine.yaml", "\n" * (number - 1) + line)
    place = Place(source, number, column, length)
    return Problem("E-TEST", place, cause, fix).render(width)


def test_the_tone():
    source = Source("robots/mine.yaml", "\n" * 16 + "    encoder: {pin: 4}\n")
    problem = Problem(
        "E-PIN-INTERRUPT",
        Place(source, 17, 20),
        "pin 4 cannot raise an interrupt",
        "use 2, 20 or 21",
    )
    assert problem.render() == (
        "robots/mine.yaml:17:20  E-PIN-INTERRUPT\n"
        "  17 |     encoder: {pin: 4}\n"
        "     |                    ^ pin 4 cannot raise an interrupt\n"
        "  use 2, 20 or 21"
    )


def test_errors_stand_before_warnings():
    warning = Problem("W-TEST", "robot.yaml", "unwise", "think", "warning")
    first, second = (Problem("E-TEST", "robot.yaml", cause, "mend it") for cause in "ab")
    text = str(ConfigurationError([*[warning] * 30, first, second]))
    assert text.startswith(f"{first.render()}\n\n{second.render()}\n\n{warning.render()}")


def test_a_warning_is_marked_as_such():
    problem = Problem("W-TEST", "robot.yaml", "unwise", "think", "warning")
    assert problem.render() == "robot.yaml  W-TEST  (warning)\n  unwise; think"


@pytest.mark.parametrize(("width", "lines"), [(17, 2), (16, 3)])
def test_a_short_cause_and_its_fix_are_one_line(width, lines):
    text = Problem("E-TEST", "port x", "absent", "plug in").render(width)  # 2 + 6 + 2 + 7 columns
    assert len(text.split("\n")) == lines


def caret_marks(text):
    """The part of the quoted line that stands above the carets."""
    _, quoted, carets, *_ = text.split("\n")
    first, last = carets.index("^"), carets.rindex("^")
    return quoted[first : last + 1]


LONG = "word: {" + "filler: 1, " * 20 + "wrong: here, " + "filler: 1, " * 20 + "}"


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("cause", ["short", "a cause of a middling length, as most are", "x " * 60])
def test_a_long_line_is_shortened_around_the_caret(width, cause):
    text = rendered(LONG, LONG.index("here") + 1, 4, cause, width=width)
    assert caret_marks(text) == "here"
    assert all(len(line) <= width for line in text.split("\n"))
    assert "..." in text.split("\n")[1]


@pytest.mark.parametrize("column", range(1, len("drive: {track: 5}") + 2))
def test_the_caret_stands_under_its_character(column):
    line = "drive: {track: 5}"
    _, quoted, carets, *_ = rendered(line, column).split("\n")
    at = carets.index("^")
    assert quoted[at : at + 1] == line[column - 1 : column]


def test_columns_beyond_the_line_point_behind_it():
    text = rendered("short", 6)
    assert text.split("\n")[2].index("^") == len("  17 | short")


def test_wide_characters_take_two_columns():
    # Three Chinese characters are six columns wide on a terminal.
    carets = rendered("名前は: 5", 6).split("\n")[2]
    assert carets.index("^") == len("  17 | ") + 8


def test_the_words_are_all_there_when_they_are_wrapped():
    cause = " ".join(f"word{i}" for i in range(40))
    text = rendered("drive: 5", 8, cause=cause)
    for i in range(40):
        assert f"word{i}" in text


def test_nothing_steers_the_terminal():
    text = rendered("a: \x1b[31mred\x07", 4, cause="\x1b]0;title\x07", fix="\x9b5m")
    assert escape_control(text.replace("\n", "")) == text.replace("\n", "")


def test_an_error_holds_all_problems_and_an_exit_code():
    problems = [Problem("E-A", "a", "first"), Problem("E-B", "b", "second")]
    error = ConfigurationError(problems)
    assert [problem.code for problem in error.problems] == ["E-A", "E-B"]
    assert str(error) == "a  E-A\n  first\n\nb  E-B\n  second"
    assert error.exit_code == 2
    assert UsageError(problems[0]).problems == (problems[0],)


def test_of_many_problems_the_first_ones_are_shown():
    error = ConfigurationError([Problem("E-A", "a", f"number {n}") for n in range(1100)])
    assert "number 29" in str(error) and "number 30" not in str(error)
    assert str(error).endswith("and 1070 more; `diffbotctl check --json` lists all of them")


@pytest.mark.parametrize(
    "word, words, near",
    [
        ("tolerence", ["tolerance", "timeout"], "tolerance"),
        ("x" * 100_000, ["x"], None),
        ("", ["a"], None),
        ("camera", ["talker", "listener"], None),
    ],
)
def test_nearest(word, words, near):
    assert closest_match(word, words) == near


@pytest.mark.parametrize(
    "words, text", [([], ""), ([2], "2"), ([2, 3], "2 or 3"), ([2, 20, 21], "2, 20 or 21")]
)
def test_listed(words, text):
    assert join_words(words) == text


@pytest.mark.parametrize(
    "text, count",
    [("a", 1), ("a\nb", 2), ("a\r\nb\rc", 3), ("a\x85b\u2028c", 3), ("a\x0cb\x0bc", 1)],
)
def test_lines_end_where_yaml_defines_it(text, count):
    assert len(Source("a", text).lines) == count


def test_a_line_beyond_the_end_is_empty():
    assert Source("a", "x").line(9) == ""
