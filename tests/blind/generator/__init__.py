"""Makes evidence folders of rigs that hide a gap; shares no line with the plant, nor with the diagnosis that it tests.

kernel.py    the rig's equations of motion and their integrator     rig.py      the numbers of one rig
surface.py   friction along the track                               runs.py     the commands of drive and piezo in each run
chain.py     the sensor chain: noise, hum, bandwidth, resolution    effect.py   an effect and its formulas
library.py   the 26 named effects                                   outside.py  effects outside the library
evidence.py  one folder on disk                                     outside_2.py  others, for sets after the first list
case.py      a case, from seed to folder

Signs as in the paper: a force is positive when it pulls in +x. The sources of the formulas are named next to them.
"""

from tests.blind.generator.case import Case, make, numbers, simulate
from tests.blind.generator.effect import Effect
from tests.blind.generator.library import LIBRARY, draw_effect
from tests.blind.generator.outside import OUTSIDE
from tests.blind.generator.outside_2 import OUTSIDE_2

__all__ = ["LIBRARY", "OUTSIDE", "OUTSIDE_2", "Case", "Effect", "draw_effect", "make", "numbers", "simulate"]
