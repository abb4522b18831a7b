"""Compiled kernels as FMUs for other tools, without Python: `plant.fmu` makes one of a rig, `controller.fmu` of a controller.

model          the content of an FMU: the memory of a kernel, and the variables in it
object_code    the kernel as position-independent machine code
description    modelDescription.xml
export         the shared library, and the archive
instance.h     an instance in C, for FMI 2 and FMI 3
fmi2.c, fmi3.c the functions for co-simulation
unsupported.c  the functions that no model here has, and functions of Python that no kernel calls
"""
