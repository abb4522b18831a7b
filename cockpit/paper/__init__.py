"""The paper redone: its figures, tables and claims.

runs     the simulated runs            claims   each claim with our number and the result
plots    the figures                   page     all of it in one offline page (template: page.html.j2)
"""
