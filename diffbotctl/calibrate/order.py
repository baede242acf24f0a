"""The steps in the order in which each finds what would spoil the next."""

from __future__ import annotations

from importlib import import_module

from diffbotctl.calibrate.step import Step

# Name of the step's command -> where its class is; imported when used.
STEPS = {
    "encoders": "diffbotctl.calibrate.encoders:Encoders",
    "motors": "diffbotctl.calibrate.motors:Motors",
    "discs": "diffbotctl.calibrate.discs:Discs",
    "distance": "diffbotctl.calibrate.distance:Distance",
    "geometry": "diffbotctl.calibrate.geometry_step:Squares",
    "range": "diffbotctl.calibrate.range_step:RangeCurve",
    "battery": "diffbotctl.calibrate.battery:Divider",
}

GEOMETRY = {
    "squares": "diffbotctl.calibrate.geometry_step:Squares",
    "spin": "diffbotctl.calibrate.spin:Spin",
    "straight": "diffbotctl.calibrate.straight:Straight",
}
"""the ways to find a geometry; the first finds all of it"""


def step(name: str, **settings: object) -> Step:
    """The step called `name`, with settings of its own such as how often it repeats.

    The setting `how` of geometry says which of its ways.
    """
    way = settings.pop("how", None)
    module, _, kind = (STEPS[name] if way is None else GEOMETRY[str(way)]).partition(":")
    made: Step = getattr(import_module(module), kind)(**settings)
    return made
