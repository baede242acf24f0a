"""Who answers behind a port, on pseudo-terminals; each takes as long as a run would."""

import pytest

from diffbotctl.testing.trials.port_answers import ANSWERS, is_right


@pytest.mark.parametrize("answer", ANSWERS, ids=lambda each: each.name)
def test_what_is_said(answer):
    assert is_right(answer)
