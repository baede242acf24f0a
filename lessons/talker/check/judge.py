"""Counts texts and answers for some seconds."""

from diffbotctl.block import Block, Every, In, Out
from diffbotctl.messages import Text
from diffbotctl.params import Param


class Judge(Block):
    """Ten texts a second, each with an answer."""

    seconds = Param(float, unit="s", default=5.0, help="Time.")
    end = Every("seconds")
    text = In(Text)
    answer = In(Text)
    finding = Out(Text)

    def reset(self):
        self.texts = self.answers = 0
        self.last_text = self.last_answer = None

    def react(self, now, end, text, answer):
        if text is not self.last_text:
            self.last_text = text
            self.texts += 1
        if answer is not self.last_answer:
            self.last_answer = answer
            self.answers += text is not None and text.text in answer.text
        if end is None:
            return None
        rate = self.texts / self.seconds
        if abs(rate - 10.0) > 0.5:
            return Text(now, f"rate: {rate:.1f} texts a second")
        if self.answers < self.texts - 1:
            return Text(now, f"answers: {self.answers} answers to {self.texts} texts")
        return Text(now, "passed")
