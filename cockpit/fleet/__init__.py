"""A fleet: many evidence folders, each diagnosed once, and one page with the gaps that rigs share.

kept.py     stored results of unchanged folders                 work.py     resumable work on all folders
groups.py   rigs that share a gap, largest benefit first        page.py     index page of a fleet
"""
