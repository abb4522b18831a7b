"""`python -m cockpit` is `stickslip`."""

from cockpit.cli import main

main()
