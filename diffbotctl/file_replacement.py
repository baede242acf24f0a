"""Writing a file whole: who reads it finds what it had before, or what it has now, never a part.

For files of which several processes may write the newest content, such as what a user has allowed,
and for files that take long to make, such as maps.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def replace_file(path: Path, data: bytes) -> None:
    """Write `data` to `path`, whose folder must be there. Raises OSError.

    The content goes to a draft beside it, which rename(2) puts in its place; where that fails the
    file keeps its content, and no draft is left.
    """
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        draft.write_bytes(data)
        draft.replace(path)
    except BaseException:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise
