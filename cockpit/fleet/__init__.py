"""A fleet: many evidence folders, each diagnosed once and kept, and one page that says which rigs share a gap.

kept.py     results of folders that need not be diagnosed again     work.py     the work on all folders, resumable
groups.py   rigs that share a gap, those first where mending helps most          page.py     the index of a fleet
"""
