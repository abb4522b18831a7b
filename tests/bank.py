"""The bank of scenarios, read once for all tests: it takes 0.25 s of CPU."""

from bench.control.scenario import load_bank

BANK = load_bank()
