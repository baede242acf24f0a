"""`--set block.param=value`: a line of configuration from the command line."""

from __future__ import annotations

from collections.abc import Iterable

from diffbotctl.config.yaml_reader import parse_any
from diffbotctl.config.yaml_tree import Value
from diffbotctl.errors import ConfigurationError, Place, Problem, Source, closest_match

SHAPE = "write --set block.parameter=value, such as --set follower.tolerance='20 mm'"


class Override:
    """One `--set`: the path that it names, and its value with its place in the words given."""

    def __init__(self, text: str) -> None:
        """Take `text` apart. Raises ConfigurationError when it is not of the form path=value."""
        source = Source("--set", text)
        path, equals, written = text.partition("=")
        self.steps = path.strip().split(".")
        self.place = Place(source, 1, 1, max(1, len(path)))
        if not equals or len(self.steps) < 2 or not all(self.steps):
            cause = "this does not say what is set to what"
            raise ConfigurationError(Problem("E-SET", self.place, cause, SHAPE))
        offset = len(path) + 1
        value = parse_any(source, " " * offset + written)
        if value is None:
            end = Place(source, 1, offset + 1)
            raise ConfigurationError(Problem("E-SET", end, "the value is missing", SHAPE))
        self.value = value.with_key(self.place)


def parse(texts: Iterable[str], problems: list[Problem]) -> list[Override]:
    """The settings in `texts`; those that cannot be read go to `problems`."""
    found: list[Override] = []
    for text in texts:
        try:
            found.append(Override(text))
        except ConfigurationError as error:
            problems += error.problems
    return found


def for_robot(robot: Value, settings: list[Override]) -> Value:
    """The robot file with every `--set robot.path=value` in it."""
    for setting in settings:
        if setting.steps[0] == "robot":
            robot = robot.with_entry(setting.steps[1:], setting.value)
    return robot


def for_pipeline(pipeline: Value, settings: list[Override], problems: list[Problem]) -> Value:
    """The pipeline file with every `--set block.param=value` and `--set vars.name=value` in it."""
    blocks = pipeline.at("blocks")
    names = list(blocks.entries) if blocks else []
    for setting in settings:
        first = setting.steps[0]
        if first == "robot":
            continue
        if first in ("vars", "goals", "world"):
            pipeline = pipeline.with_entry(setting.steps, setting.value)
        elif first in names:
            steps = ("blocks", first, "with", *setting.steps[1:])
            pipeline = pipeline.with_entry(steps, setting.value)
        else:
            problems.append(_unknown(setting, [*names, "robot", "vars"]))
    return pipeline


def _unknown(setting: Override, names: list[str]) -> Problem:
    first = setting.steps[0]
    near = closest_match(first, names)
    fix = f"did you mean {near}?" if near else f"it has {', '.join(names)}"
    return Problem("E-SET", setting.place, f"the pipeline has no block '{first}'", fix)
