"""Files to checked configuration, with errors that teach."""
