"""Rigs of another workshop, with its own benches, campaigns and faults, for `python -m tests.blind`.

rigs        three kinds of rig: described numbers, true numbers, friction law, surface, sensors
campaigns   the runs that a bench makes: motion of the drive and vibration
sizes       effects of the library in forms and sizes of these benches
outside     effects that the library lacks
measure     one simulated run with its sensors
evidence    `Workshop`, which draws effects and writes evidence
"""

from tests.blind.workshop.evidence import Workshop

__all__ = ["Workshop"]
