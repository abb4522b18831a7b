/* The functions of FMI 2 for co-simulation: arrays do not exist, so an output has its last value and its mean. */
#include "fmi2Functions.h"
#include "instance.h"

static int refuse(Instance *i, const char *text) {
    if (i->log) ((fmi2CallbackLogger)i->log)(i->environment, "", fmi2Error, "logStatusError", text);
    return ERROR;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    return (void)c, (void)on, (void)n, (void)categories, fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
        const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)resources, (void)visible;
    void (*log)() = functions && logging ? (void (*)())functions->logger : NULL;
    return type == fmi2CoSimulation ? made(token, functions ? functions->componentEnvironment : NULL, log) : NULL;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real from, fmi2Boolean stops,
        fmi2Real stop) {
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    return *(double *)((Instance *)c)->memory = from, fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return (void)c, fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return set_state(c, start); }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[]) {
    return get(c, r, n, values, n, Float64, sizeof *values);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[]) {
    return set(c, r, n, values, n, Float64, sizeof *values);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real length, fmi2Boolean final) { return (void)final, step(c, now, length); }

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return get_state(c, state); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return set_state(c, state); }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { return (void)c, free_state(state); }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    return (void)c, (void)state, *size = MEMORY_BYTES, fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return write_state(c, state, bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    return read_state(c, bytes, size, state);
}
