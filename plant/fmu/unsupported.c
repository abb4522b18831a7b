/* Functions of FMI 3 that this model does not have: a caller that asks for one gets fmi3Error. The arguments do not matter, as
   on x86-64 the caller passes and removes them; so this file must not include the header with their types. */
#include <stdlib.h>

#define ERROR(name) __attribute__((visibility("default"))) int name(void) { return 3; }
#define NONE(name) __attribute__((visibility("default"))) void *name(void) { return NULL; }
NONE(fmi3InstantiateModelExchange) NONE(fmi3InstantiateScheduledExecution)
ERROR(fmi3GetFloat32) ERROR(fmi3GetInt8) ERROR(fmi3GetUInt8) ERROR(fmi3GetInt16) ERROR(fmi3GetUInt16) ERROR(fmi3GetInt32)
ERROR(fmi3GetUInt32) ERROR(fmi3GetInt64) ERROR(fmi3GetUInt64) ERROR(fmi3GetBoolean) ERROR(fmi3GetString) ERROR(fmi3GetBinary)
ERROR(fmi3GetClock) ERROR(fmi3SetFloat32) ERROR(fmi3SetInt8) ERROR(fmi3SetUInt8) ERROR(fmi3SetInt16) ERROR(fmi3SetUInt16)
ERROR(fmi3SetInt32) ERROR(fmi3SetUInt32) ERROR(fmi3SetInt64) ERROR(fmi3SetUInt64) ERROR(fmi3SetBoolean) ERROR(fmi3SetString)
ERROR(fmi3SetBinary) ERROR(fmi3SetClock) ERROR(fmi3EnterEventMode) ERROR(fmi3GetNumberOfVariableDependencies)
ERROR(fmi3GetVariableDependencies) ERROR(fmi3GetDirectionalDerivative) ERROR(fmi3GetAdjointDerivative)
ERROR(fmi3EnterConfigurationMode) ERROR(fmi3ExitConfigurationMode) ERROR(fmi3GetIntervalDecimal)
ERROR(fmi3GetIntervalFraction) ERROR(fmi3GetShiftDecimal) ERROR(fmi3GetShiftFraction) ERROR(fmi3SetIntervalDecimal)
ERROR(fmi3SetIntervalFraction) ERROR(fmi3SetShiftDecimal) ERROR(fmi3SetShiftFraction) ERROR(fmi3EvaluateDiscreteStates)
ERROR(fmi3UpdateDiscreteStates) ERROR(fmi3EnterContinuousTimeMode) ERROR(fmi3CompletedIntegratorStep) ERROR(fmi3SetTime)
ERROR(fmi3SetContinuousStates) ERROR(fmi3GetContinuousStateDerivatives) ERROR(fmi3GetEventIndicators)
ERROR(fmi3GetContinuousStates) ERROR(fmi3GetNominalsOfContinuousStates) ERROR(fmi3GetNumberOfEventIndicators)
ERROR(fmi3GetNumberOfContinuousStates) ERROR(fmi3EnterStepMode) ERROR(fmi3GetOutputDerivatives)
ERROR(fmi3ActivateModelPartition)

/* What the frame that numba puts around a kernel would call to raise an exception of Python; the kernel raises none. */
#define NEVER(name) void *name(void) { abort(); }
NEVER(NRT_Free) NEVER(NRT_MemInfo_call_dtor) NEVER(PyBytes_FromStringAndSize) NEVER(PyErr_Clear) NEVER(PyErr_SetNone)
NEVER(PyErr_SetString) NEVER(PyErr_WriteUnraisable) NEVER(PyUnicode_FromString) NEVER(Py_DecRef) NEVER(numba_do_raise)
NEVER(numba_gil_ensure) NEVER(numba_gil_release) NEVER(numba_runtime_build_excinfo_struct) NEVER(numba_unpickle)
void *PyExc_RuntimeError, *PyExc_StopIteration, *PyExc_SystemError;
