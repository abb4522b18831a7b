"""Rigs of other kinds: a turntable on a torsion spring, a polymer slider, a gantry that a motor pushes.

They share no line with plant and diagnosis: other friction laws (elasto-plastic, Dahl, Maxwell slip), surfaces of 0.1 to 10 %
with several lengths, and commands with stops, trapezoids and sines. Formats of effects come from `tests.blind.generator`.

kernel.py    equations of motion     rigs.py    the three rigs, their runs, sensors and evidence folders
effects.py   effects of the library and outside it
"""

from tests.blind.machines.rigs import MACHINES, Machines

__all__ = ["MACHINES", "Machines"]
