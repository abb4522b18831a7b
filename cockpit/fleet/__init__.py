"""A fleet: many evidence folders, each diagnosed once, and one page with the gaps that rigs share.

work.py     resumable work on all folders: stored results, reports, index page
groups.py   rigs that share a gap, largest benefit first
"""
