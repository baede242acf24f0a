"""Notes when the gate of a running engine commands the wheels, on the clock of this process."""

import threading
import time
from pathlib import Path

from diffbotctl.processes.real_time import prefer
from tests.support.running import PlainClient

WAIT_S = 60.0  # for what must come; a trial fails by itself afterwards


class WheelWatcher:
    """Follows the wheels of the engine called `name` in `folder`.

    `moved_at` is when they were last commanded to turn (monotonic, s).
    """

    def __init__(self, folder: Path, name: str = "test") -> None:
        self.client = PlainClient(folder, name)
        self.client.request("subscribe", topic="gate.wheels")
        self.news = threading.Condition()
        self.is_zero = True
        self.changed = 0.0
        self.moved_at = 0.0
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        prefer()
        while (line := self.client.read()) is not None:
            message = line.get("message")
            if message is None:
                continue
            is_zero = message["left"] == 0 == message["right"]
            with self.news:
                if not is_zero:
                    self.moved_at = time.monotonic()
                if is_zero != self.is_zero:
                    self.is_zero, self.changed = is_zero, time.monotonic()
                    self.news.notify_all()

    def wait(self, is_zero: bool) -> float:
        """Wait until the wheels are commanded to zero, or to turn; returns when that began."""
        with self.news:
            came = self.news.wait_for(lambda: self.is_zero == is_zero, WAIT_S)
            assert came, f"the wheels were never commanded {'to zero' if is_zero else 'to turn'}"
            return self.changed
