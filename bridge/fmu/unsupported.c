/* Functions of FMI that the models here do not have: a caller that asks for one gets the status Error. The arguments do not
   matter, as on x86-64 the caller passes and removes them; so this file must not include the headers with their types. */
#include <stdlib.h>

#define ERROR(name) __attribute__((visibility("default"))) int name(void) { return 3; }
#define NONE(name) __attribute__((visibility("default"))) void *name(void) { return NULL; }
#if FMI == 2
ERROR(fmi2GetInteger) ERROR(fmi2GetBoolean) ERROR(fmi2GetString) ERROR(fmi2SetInteger) ERROR(fmi2SetBoolean)
ERROR(fmi2SetString) ERROR(fmi2GetDirectionalDerivative) ERROR(fmi2SetRealInputDerivatives)
ERROR(fmi2GetRealOutputDerivatives) ERROR(fmi2CancelStep) ERROR(fmi2GetStatus) ERROR(fmi2GetRealStatus)
ERROR(fmi2GetIntegerStatus) ERROR(fmi2GetBooleanStatus) ERROR(fmi2GetStringStatus)
#else
NONE(fmi3InstantiateModelExchange) NONE(fmi3InstantiateScheduledExecution) ERROR(fmi3GetInt8) ERROR(fmi3GetUInt8)
ERROR(fmi3GetInt16) ERROR(fmi3GetUInt16) ERROR(fmi3GetInt32) ERROR(fmi3GetBoolean) ERROR(fmi3GetString) ERROR(fmi3GetBinary)
ERROR(fmi3GetClock) ERROR(fmi3SetInt8) ERROR(fmi3SetUInt8) ERROR(fmi3SetInt16) ERROR(fmi3SetUInt16) ERROR(fmi3SetInt32)
ERROR(fmi3SetBoolean) ERROR(fmi3SetString) ERROR(fmi3SetBinary) ERROR(fmi3SetClock) ERROR(fmi3EnterEventMode)
ERROR(fmi3GetNumberOfVariableDependencies) ERROR(fmi3GetVariableDependencies) ERROR(fmi3GetDirectionalDerivative)
ERROR(fmi3GetAdjointDerivative) ERROR(fmi3EnterConfigurationMode) ERROR(fmi3ExitConfigurationMode)
ERROR(fmi3GetIntervalDecimal) ERROR(fmi3GetIntervalFraction) ERROR(fmi3GetShiftDecimal) ERROR(fmi3GetShiftFraction)
ERROR(fmi3SetIntervalDecimal) ERROR(fmi3SetIntervalFraction) ERROR(fmi3SetShiftDecimal) ERROR(fmi3SetShiftFraction)
ERROR(fmi3EvaluateDiscreteStates) ERROR(fmi3UpdateDiscreteStates) ERROR(fmi3EnterContinuousTimeMode)
ERROR(fmi3CompletedIntegratorStep) ERROR(fmi3SetTime) ERROR(fmi3SetContinuousStates) ERROR(fmi3GetContinuousStateDerivatives)
ERROR(fmi3GetEventIndicators) ERROR(fmi3GetContinuousStates) ERROR(fmi3GetNominalsOfContinuousStates)
ERROR(fmi3GetNumberOfEventIndicators) ERROR(fmi3GetNumberOfContinuousStates) ERROR(fmi3EnterStepMode)
ERROR(fmi3GetOutputDerivatives) ERROR(fmi3ActivateModelPartition)
#endif

/* What the frame that numba puts around a kernel would call to raise an exception of Python; no kernel raises one. */
#define NEVER(name) void *name(void) { abort(); }
NEVER(NRT_Free) NEVER(NRT_MemInfo_call_dtor) NEVER(PyBytes_FromStringAndSize) NEVER(PyErr_Clear) NEVER(PyErr_SetNone)
NEVER(PyErr_SetString) NEVER(PyErr_WriteUnraisable) NEVER(PyUnicode_FromString) NEVER(Py_DecRef) NEVER(numba_do_raise)
NEVER(numba_gil_ensure) NEVER(numba_gil_release) NEVER(numba_runtime_build_excinfo_struct) NEVER(numba_unpickle)
void *PyExc_RuntimeError, *PyExc_StopIteration, *PyExc_SystemError;

/* Strides of an array of another shape with the same elements, as for the minimum of an array; no array here has gaps. */
int numba_attempt_nocopy_reshape(long dimensions, const long *lengths, const long *strides, long new_dimensions,
        const long *new_lengths, long *new_strides, long size, int is_fortran) {
    (void)dimensions, (void)lengths, (void)strides, (void)is_fortran;
    for (long k = new_dimensions; k-- > 0; size *= new_lengths[k]) new_strides[k] = size;
    return 1;
}
