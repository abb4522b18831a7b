/* A rig as an FMU of FMI 3 for co-simulation: one step is one block of the plant's kernel, or several. The export writes model.h. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "model.h" /* PARAMS_BYTES, STATE_BYTES, start_params, start_state, SAMPLES, BLOCK_S, TOKEN, offsets */

enum { TIME, DRIVE, FREQUENCY, AMPLITUDE, LOAD, CHANNEL, TRUTH = CHANNEL + CHANNELS, PARAMETER = TRUTH + TRUTHS };

void stickslip_block(void *params, void *state, double drive, double frequency, double amplitude, double *analogue, double *truth);

typedef struct { /* all that changes: states of the FMU are copies of it */
    double time_s, input[LOAD + 1];
    double analogue[CHANNELS * SAMPLES], truth[TRUTHS * SAMPLES];
    _Alignas(16) unsigned char params[PARAMS_BYTES], state[STATE_BYTES];
} Model;

typedef struct {
    Model model;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

static void start(Model *m) {
    memset(m, 0, sizeof *m);
    memcpy(m->params, start_params, PARAMS_BYTES);
    memcpy(m->state, start_state, STATE_BYTES);
    m->input[DRIVE] = START_DRIVE_MPS;
    m->input[FREQUENCY] = START_FREQUENCY_HZ;
    m->input[LOAD] = 1.0;
}

static fmi3Status refuse(Instance *i, const char *text) {
    if (i && i->log) i->log(i->environment, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

static double *parameter(Model *m, size_t index) { return (double *)(m->params + offsets[index]); }

/* The value of a variable: its address, and its length in *n; NULL for a reference that the model does not have. */
static double *variable(Model *m, fmi3ValueReference reference, size_t *n) {
    *n = 1;
    if (reference == TIME) return &m->time_s;
    if (reference <= LOAD) return &m->input[reference];
    if (reference < TRUTH) { *n = SAMPLES; return m->analogue + (reference - CHANNEL) * SAMPLES; }
    if (reference < PARAMETER) { *n = SAMPLES; return m->truth + (reference - TRUTH) * SAMPLES; }
    return reference < PARAMETER + PARAMETERS ? parameter(m, reference - PARAMETER) : NULL;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
        fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
        fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)events, (void)early, (void)required, (void)n, (void)update;
    Instance asking = {.environment = environment, .log = logging ? log : NULL};
    if (!token || strcmp(token, TOKEN)) return refuse(&asking, "the token is that of another model"), NULL;
    Instance *i = malloc(sizeof *i);
    if (!i) return refuse(&asking, "no memory"), NULL;
    i->environment = asking.environment, i->log = asking.log;
    start(&i->model);
    return i;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 from,
        fmi3Boolean stops, fmi3Float64 stop) {
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    ((Instance *)c)->model.time_s = from;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return (void)c, fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { return (void)c, fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { return start(&((Instance *)c)->model), fmi3OK; }

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Float64 values[], size_t length) {
    Instance *i = c;
    size_t at = 0, size;
    for (size_t k = 0; k < n; k++) {
        const double *from = variable(&i->model, references[k], &size);
        if (!from || at + size > length) return refuse(i, "no such variable, or too few values for it");
        memcpy(values + at, from, size * sizeof *values);
        at += size;
    }
    return at == length ? fmi3OK : refuse(i, "more values than the variables have");
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[], size_t length) {
    Instance *i = c;
    size_t size;
    if (n != length) return refuse(i, "each variable that can be set has one value");
    for (size_t k = 0; k < n; k++) {
        fmi3ValueReference r = references[k];
        if (r == TIME || (r > LOAD && r < PARAMETER) || r >= PARAMETER + PARAMETERS)
            return refuse(i, "must be an input or a parameter");
        if (!isfinite(values[k])) return refuse(i, "an input or a parameter must be a finite number");
        *variable(&i->model, r, &size) = values[k];
    }
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 now, fmi3Float64 step, fmi3Boolean final, fmi3Boolean *event,
        fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    (void)final;
    Instance *i = c;
    Model *m = &i->model;
    double blocks = round(step / BLOCK_S);
    if (blocks < 1.0 || fabs(step - blocks * BLOCK_S) > 1e-6 * BLOCK_S) return refuse(i, "a step must be whole blocks");
    *(double *)(m->params + F_C_OFFSET) = m->input[LOAD] * *(const double *)(start_params + F_C_OFFSET);
    *(double *)(m->params + F_S_OFFSET) = m->input[LOAD] * *(const double *)(start_params + F_S_OFFSET);
    for (double block = 0.0; block < blocks; block++)
        stickslip_block(m->params, m->state, m->input[DRIVE], m->input[FREQUENCY], m->input[AMPLITUDE], m->analogue, m->truth);
    m->time_s = now + step;
    *event = *terminate = *early = false;
    *reached = m->time_s;
    return isfinite(m->truth[SLIDE_ROW * SAMPLES + SAMPLES - 1]) ? fmi3OK : refuse(i, "the velocity of the slide is no number");
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    if (!*state && !(*state = malloc(sizeof(Model)))) return refuse(c, "no memory");
    memcpy(*state, &((Instance *)c)->model, sizeof(Model));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    memcpy(&((Instance *)c)->model, state, sizeof(Model));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Model);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    if (size != sizeof(Model)) return refuse(c, "the size of a state is that of fmi3SerializedFMUStateSize");
    memcpy(bytes, state, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    if (size != sizeof(Model)) return refuse(c, "the bytes are no state of this model");
    fmi3Status status = fmi3GetFMUState(c, state);
    if (status == fmi3OK) memcpy(*state, bytes, size);
    return status;
}
