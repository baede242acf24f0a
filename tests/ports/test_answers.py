"""Which board answers on a port, on pseudo-terminals; each takes as long as in a run."""

import pytest

from tests.support.trials.port_answers import ANSWERS, is_right


@pytest.mark.parametrize("answer", ANSWERS, ids=lambda each: each.name)
def test_the_answer_is_identified(answer):
    assert is_right(answer)
