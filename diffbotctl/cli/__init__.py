"""The command line: each command a file, imported when it is named."""

COMPLETING = "_DIFFBOTCTL_COMPLETE"  # variable that the shell's completion sets
