"""The chain of relations between channels as regressions over all samples; no simulation.

relation            one relation: its residual, its columns, and where it holds
spring, spring_effects, motion, drive, exciter, base    the five relations and their columns
shapes              a channel behind a play, a mode, or as a free function of a variable
products            inner products by run and band of frequency; noise by REML
search              evidence of single causes, pairs and triples
outside             patterns and bursts that no column explains
shares              shares on the held-out runs, with intervals and the shares that noise alone shows
answer              all relations of an evidence, searched
decide              the causes that they name, and patterns outside the library
"""
