"""Checks of the diagnosis on rigs it has never seen."""
