"""A simulated rig as an FMU: the plant's compiled kernel behind the functions of FMI 3, without Python.

object_code    the kernel as position-independent machine code
export         the model description, and the FMU
fmi3.c         the functions of FMI 3 for co-simulation
unsupported.c  the functions of FMI 3 that this model does not have, and functions of Python that the kernel never calls
"""
