"""`python -m bench`."""

from bench.app import app
from cockpit.entry import main

main(app)
