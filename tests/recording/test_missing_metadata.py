"""Recordings whose metadata lack a name that may also be empty."""

from pathlib import Path

from diffbotctl.replay.recorded_run import read_run, recorded_configuration

TURTLE = Path(__file__).parents[1] / "data" / "recordings" / "turtle.mcap"


def test_a_recording_that_names_no_robot_is_read_with_the_one_of_its_pipeline():
    about = dict(read_run(TURTLE).about)
    about.pop("robot")
    with recorded_configuration(Path(), about) as configuration:
        assert configuration.name == "turtle"
