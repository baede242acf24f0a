"""Commands called in this process, for tests that need no process of their own."""

from click.testing import CliRunner


def invoke(command, *words):
    """Exit code and output of a command; what it raises is raised."""
    result = CliRunner().invoke(command, list(map(str, words)), standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.return_value, result.output
