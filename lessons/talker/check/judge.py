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
        self.first_text = self.last_text = self.last_answer = None

    def react(self, now, end, text, answer):
        if text is not self.last_text:
            self.first_text, self.last_text = self.first_text or text, text
            self.texts += 1
        if answer is not self.last_answer:
            self.last_answer = answer
            self.answers += text is not None and text.text in answer.text
        if end is None:
            return None
        time = (self.last_text.time - self.first_text.time) / 1e9 if self.texts > 1 else 0.0
        if not 9.5 * time <= self.texts - 1 <= 10.5 * time or self.texts < 2:
            return Text(now, f"rate: {self.texts} texts in {self.seconds:.1f} s")
        if self.answers < self.texts - 1:
            return Text(now, f"answers: {self.answers} answers to {self.texts} texts")
        return Text(now, "passed")
