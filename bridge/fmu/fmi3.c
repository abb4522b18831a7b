/* The functions of FMI 3 for co-simulation. */
#include "fmi3Functions.h"
#include "instance.h"

static int refuse(Instance *i, const char *text) {
    if (i->log) ((fmi3LogMessageCallback)i->log)(i->environment, fmi3Error, "logStatusError", text);
    return ERROR;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    return (void)c, (void)on, (void)n, (void)categories, fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
        fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
        fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)events, (void)early, (void)required, (void)n, (void)update;
    return made(token, environment, logging ? (void (*)())log : NULL);
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 from,
        fmi3Boolean stops, fmi3Float64 stop) {
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    return *(double *)((Instance *)c)->memory = from, fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return (void)c, fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return (void)c, fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { return set_state(c, start); }

#define ACCESS(Type) \
    fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3##Type values[], size_t length) { \
        return get(c, r, n, values, length, Type, sizeof *values); \
    } \
    fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3##Type values[], size_t length) { \
        return set(c, r, n, values, length, Type, sizeof *values); \
    }
ACCESS(Float64) ACCESS(Float32) ACCESS(Int64) ACCESS(UInt64) ACCESS(UInt32)

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 now, fmi3Float64 length, fmi3Boolean final, fmi3Boolean *event,
        fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    (void)final;
    *event = *terminate = *early = false;
    fmi3Status status = step(c, now, length);
    return *reached = *(const double *)((Instance *)c)->memory, status;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return get_state(c, state); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return set_state(c, state); }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { return (void)c, free_state(state); }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    return (void)c, (void)state, *size = MEMORY_BYTES, fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return write_state(c, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return read_state(c, bytes, size, state);
}
