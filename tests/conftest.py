"""Tests run from the root of the checkout, as a person would."""

import os
from pathlib import Path

os.chdir(Path(__file__).parent.parent)
