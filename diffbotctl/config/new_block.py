"""The files of a new package with one block: block, test, metadata, and a pipeline that uses it."""

from __future__ import annotations

BLOCK = '''\
"""{Name}: a velocity in, a share of it out. Change this into what your block does."""

from __future__ import annotations

from diffbotctl.block import Block, In, Out
from diffbotctl.messages import Twist
from diffbotctl.params import Param


class {Name}(Block):
    """Let through only a share of the wanted velocity."""

    share = Param(float, default=0.5, unit="1", above=0, most=1, help="Share that is let through.")
    wanted = In(Twist)
    twist = Out(Twist)

    def react(self, now: int, wanted: Twist | None) -> Twist | None:
        """One instant. `now`: logical time in ns; an input that never came is None."""
        if wanted is None:
            return None
        return Twist(now, wanted.linear * self.share, wanted.angular * self.share)
'''

TEST = '''\
"""The block alone, by hand: no engine, no clock, no robot."""

import pytest
from {package}.{name} import {Name}

from diffbotctl.messages import Twist

CASES = [
    # share, wanted (m/s, rad/s), let through
    (0.5, (0.4, 2.0), (0.2, 1.0)),  # half of both, so that the robot drives the same arc
    (1.0, (-0.3, 0.0), (-0.3, 0.0)),  # all of it, backwards too
]


@pytest.mark.parametrize(("share", "wanted", "expected"), CASES)
def test_a_share_is_let_through(share, wanted, expected):
    block = {Name}(share=share)
    assert block.react(5, Twist(3, *wanted)) == Twist(5, *expected)


def test_nothing_wanted_is_nothing_said():
    assert {Name}().react(5, None) is None
'''

SETUP = """\
[metadata]
name = {project}
version = 0.1.0
description = A block for diffbotctl: {name}.

[options]
python_requires = >=3.11
packages = {package}
install_requires = diffbotctl

[options.entry_points]
diffbotctl.blocks =
    {name} = {package}.{name}:{Name}
"""

PYPROJECT = """\
[build-system]
requires = ["setuptools>=61"]
build-backend = "setuptools.build_meta"
"""

PIPELINE = """\
# The shipped `goal`, with {name} between the speed limiter and the guard.
format: 1
kind: pipeline
include: goal

blocks:
  {name}: {{block: {name}, in: {{wanted: limiter.twist}}, with: {{share: 0.5}}}}
  guard: {{in: {{twist: {name}.twist}}}}
"""

README = """\
# {project}

A block for `diffbotctl`.

    pip install -e .                     # once; what you change counts at the next run
    pytest                               # the block alone, by hand
    diffbotctl blocks show {name}
    diffbotctl run ./{name}.yaml --fast
"""


def files(name: str) -> dict[str, str]:
    """Path below the new folder, and text, of every file for the block called `name`."""
    package = f"diffbot_{name}"
    words = {
        "name": name,
        "Name": "".join(word.capitalize() for word in name.split("_")),
        "package": package,
        "project": package.replace("_", "-"),
    }
    texts = {
        f"{package}/__init__.py": '"""A block for diffbotctl: {name}."""\n',
        f"{package}/{name}.py": BLOCK,
        f"tests/test_{name}.py": TEST,
        f"{name}.yaml": PIPELINE,
        "setup.cfg": SETUP,
        "pyproject.toml": PYPROJECT,
        "README.md": README,
    }
    return {path: text.format(**words) for path, text in texts.items()}
