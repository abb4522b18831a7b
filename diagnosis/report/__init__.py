"""The report of a finished diagnosis.

assemble           a diagnosis from fits and verdict, or from relations and latent friction alone
words, summary     effects and verdicts in words; the answer in six lines
page, page_plots   the answer as one offline HTML file (template: page.html.j2); its pictures
rig_file           a rig file with the refitted numbers and the named effects
relations_block    the part of the relations and of the latent friction in an answer
"""
