"""The report of a finished diagnosis.

assemble           fits and verdict put together as one diagnosis
words, summary     effects and verdicts in words; the whole answer in sentences
page, page_plots   the answer as one offline HTML file (template: page.html.j2); its pictures
rig_file           a rig file with the refitted numbers and the named effects
"""
