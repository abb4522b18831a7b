"""The report of a finished diagnosis.

assemble           a diagnosis from fits and verdict
words, summary     effects and verdicts in words; the answer in sentences
page, page_plots   the answer as one offline HTML file (template: page.html.j2); its pictures
rig_file           a rig file with the refitted numbers and the named effects
latent_block       the latent friction's part of an answer
relation_words     the relations of a diagnosis in words
relations_block    the relations' part of an answer
without_fits       a diagnosis from relations and latent friction alone, if no fit can compare the runs or ends in time
"""
