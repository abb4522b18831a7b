"""How good the diagnosis is: made-up rigs by the hundred, each diagnosed and scored; `python -m tests.campaign` runs it.

sizes, cases      how large an effect is drawn; which cases a campaign has
running           a case from nothing to its result
detectability     how far above its detection limit a case is
scoring, table    what it amounts to; the same as text
"""
