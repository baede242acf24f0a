"""Fixtures of the tests of commands."""

import pytest


@pytest.fixture
def empty_folder(tmp_path, monkeypatch):
    """The current folder is a new one, and so is the cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
