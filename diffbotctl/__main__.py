"""`python -m diffbotctl`."""

from diffbotctl.cli.main import main

main()
