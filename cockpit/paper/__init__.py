"""The paper redone: its figures, tables and claims.

runs     the simulated runs            claims   each claim with the simulated number and the result
plots    the figures                   page     one offline page with all of them (template: page.html.j2)
"""
