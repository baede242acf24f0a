"""Wheel-speed control: the speed loop, its feed-forward, and motion profiles."""
