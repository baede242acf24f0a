"""temporary"""


class RunError(Exception):
    """t"""

    def __init__(self, *, place: str, cause: str, fix: str) -> None:
        super().__init__(f"{place}: {cause}")
        self.place, self.cause, self.fix = place, cause, fix
