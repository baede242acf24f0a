"""The page of a running robot: its server, sessions, certificate and assets."""
