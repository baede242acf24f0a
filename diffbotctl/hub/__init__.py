"""What watches and remembers a run, in processes of its own: recordings, screens, sockets."""
