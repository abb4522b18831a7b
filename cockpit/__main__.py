"""`python -m cockpit` is `stickslip`."""

from cockpit.entry import main

main()
