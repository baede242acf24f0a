"""What lives in a thread of its own beside a test, until it is closed."""

import threading


class Alongside:
    """A subclass has `live`, which goes on until `over` is set, and `let_go`, called after it."""

    def begin(self):
        """Live from now on; last in a constructor."""
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.live, daemon=True)
        self.thread.start()

    def close(self):
        """End it, and let go of what it held."""
        self.over.set()
        self.thread.join()
        self.let_go()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
