"""Programs of a pipeline: supervised child processes that read and publish messages."""
