"""The commands that are more than a few lines; `cli` has the others.

diagnose, diagnose_output   evidence to a diagnosis; its progress and its words on a terminal
blind, log, replay          groups of commands
options                     what several commands have
"""
