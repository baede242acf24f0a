"""The server for Foxglove and Lichtblick: its protocol, its channels, what a viewer may do."""
