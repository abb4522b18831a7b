"""The paper redone: its figures, tables and claims.

runs     what is simulated            claims   each claim with its number and whether it holds
plots    the figures                  page     all of it in one offline page (template: page.html.j2)
"""
