"""The request handlers of the control socket."""
