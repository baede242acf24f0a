"""Words that stand for a vague thought, in names and prose: each has a literal substitute."""

import re
import subprocess
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parent.parent
SUBSTITUTES = {
    "told": "reported, stated, printed, commanded",
    "tells": "reports, states, shows; to tell apart: to distinguish",
    "says": "states, reports, prints",
    "said": "stated, printed; for text: output, answer",
    "hear": "receive, detect",
    "deaf": "silent, not reading",
    "believe": "estimate, accept, trust",
    "nobody": "no client, no one; better: what is missing",
    "stretch": "interval, period, segment",
    "twin": "copy, duplicate, second",
    "seat": "slot, position",
    "wanted": "target, command, expected, requested",
}
# With the plain inflections of each; parts of names count, such as in `wanted_speed`.
PATTERN = re.compile(rf"(?<![a-z])({'|'.join(SUBSTITUTES)})(?:s|d|es|ed|ing)?(?![a-z])")
CAMEL_CASE = re.compile(r"(?<=[a-z])(?=[A-Z])")
# Words that others define: (file, word, the text around it).
GIVEN = [
    ("diffbotctl/blocks/listener.py", "hear", "the answer in the talker and listener of ROS"),
    ("docs/reference.md", "hear", "the reference of that block"),
    ("lessons/talker/lesson.md", "hear", "a wire of that block"),
    ("lessons/talker/check/judge.yaml", "hear", "a wire of that block"),
    ("diffbotctl/diagnostics/private_text.py", "nobody", "a user of every Linux system"),
    ("diffbotctl/templates/unit.service.tmpl", "wanted", "the key WantedBy of systemd"),
    ("diffbotctl/web/assets/page.css", "stretch", "a value of the CSS property align-items"),
    ("tests/test_words.py", None, "the pattern itself"),
]
TESTS = ("tests/", "prove/")
TESTS_MAX = 100
TEXT = (
    *(".py", ".pyi", ".c", ".h", ".cpp", ".S", ".ld", ".mjs", ".js", ".html", ".css", ".svg"),
    *(".yaml", ".yml", ".md", ".tmpl", ".sh", ".toml", ".cfg", ".json", ".ino", "Makefile", "/run"),
)


def words_of(name):
    """(place, word) of each such word in a file, and in its name."""
    given = {word for file, word, _ in GIVEN if file == name}
    if None in given:
        return []
    lines = enumerate([name, *(ROOT / name).read_text().splitlines()])
    return [
        (f"{name}:{number}", found[1])
        for number, line in lines
        for found in PATTERN.finditer(CAMEL_CASE.sub("_", line).lower())
        if found[1] not in given
    ]


def found_words():
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    names = [name for name in listed.stdout.splitlines() if name.endswith(TEXT)]
    assert len(names) > 500
    return [found for name in names if (ROOT / name).is_file() for found in words_of(name)]


def report(found):
    return "\n".join(f"{place}: {word}; write: {SUBSTITUTES[word]}" for place, word in found)


def test_the_package_and_its_documents_use_literal_words():
    found = [each for each in found_words() if not each[0].startswith(TESTS)]
    assert not found, f"\n{report(found)}"


def test_tests_use_few_words_that_are_not_literal():
    found = [each for each in found_words() if each[0].startswith(TESTS)]
    by_file = Counter(place.partition(":")[0] for place, _ in found)
    assert len(found) <= TESTS_MAX, f"{len(found)} in {dict(by_file)}\n{report(found)}"


def test_each_exception_is_in_use():
    """An exception without its word would hide the next use of it."""
    for name, word, _ in GIVEN:
        text = (ROOT / name).read_text().lower()
        assert word is None or word in text, f"{name}: {word}"
