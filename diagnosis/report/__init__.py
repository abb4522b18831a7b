"""The answer, once it is there.

assemble           what came out of the search and the verdict, put together
words, summary     effects and verdicts in words; the answer in sentences
page, page_plots   one offline HTML file (template: page.html.j2); its pictures
rig_file           a rig file with the refitted numbers and the named effects
"""
