"""Running a recording again."""
