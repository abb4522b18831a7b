/* An instance is a copy of the memory `start`, whose parts are the variables; a step is a call of the kernel. FMI 2 and FMI 3
   number their status alike. The export writes model.h. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { OK = 0, ERROR = 3 };
enum { Float64, Float32, Int64, UInt64, UInt32 }; /* type of a variable */
enum { OUTPUT, MEAN, INPUT, FINITE };             /* MEAN: of an output's values; FINITE: an input that must be a number */

typedef struct {
    size_t at, count; /* place in the memory, in bytes; number of values */
    int type, access;
} Variable;

#include "model.h" /* MEMORY_BYTES, STEP_S, MOST_STEPS, TOKEN, start, VARIABLES, variables, kernel */

typedef struct {
    _Alignas(16) unsigned char memory[MEMORY_BYTES]; /* all that changes, the time first: a state is a copy of it */
    void *environment, (*log)();
} Instance;

static int refuse(Instance *i, const char *text);

static Instance *made(const char *token, void *environment, void (*log)()) {
    Instance asking = {.environment = environment, .log = log}, *i = NULL;
    if (!token || strcmp(token, TOKEN)) refuse(&asking, "the token is that of another model");
    else if (!(i = malloc(sizeof *i))) refuse(&asking, "no memory");
    else memcpy(memcpy(i, &asking, sizeof *i), start, MEMORY_BYTES);
    return i;
}

/* A variable of one type that the caller may get, or set; NULL for any other reference. */
static const Variable *variable(unsigned reference, int type, int least_access) {
    if (reference >= VARIABLES) return NULL;
    const Variable *v = &variables[reference];
    return v->type == type && v->access >= least_access ? v : NULL;
}

static int get(Instance *i, const unsigned references[], size_t n, void *values, size_t length, int type, size_t size) {
    unsigned char *to = values, *end = to + length * size;
    for (size_t k = 0; k < n; k++) {
        const Variable *v = variable(references[k], type, OUTPUT);
        size_t bytes = !v ? 0 : v->access == MEAN ? size : v->count * size;
        if (!v || bytes > (size_t)(end - to)) return refuse(i, "no such variable of this type, or too few values for it");
        if (v->access == MEAN) {
            double sum = 0.0;
            for (size_t at = 0; at < v->count; at++) sum += ((const double *)(i->memory + v->at))[at];
            *(double *)to = sum / v->count;
        } else memcpy(to, i->memory + v->at, bytes);
        to += bytes;
    }
    return to == end ? OK : refuse(i, "more values than the variables have");
}

static int set(Instance *i, const unsigned references[], size_t n, const void *values, size_t length, int type, size_t size) {
    const unsigned char *from = values, *end = from + length * size;
    for (size_t k = 0; k < n; k++) {
        const Variable *v = variable(references[k], type, INPUT);
        if (!v || v->count * size > (size_t)(end - from))
            return refuse(i, "must be an input or a parameter of this type, with all of its values");
        if (v->access == FINITE && !isfinite(*(const double *)from))
            return refuse(i, "an input or a parameter must be a finite number");
        memcpy(i->memory + v->at, from, v->count * size);
        from += v->count * size;
    }
    return from == end ? OK : refuse(i, "more values than the variables have");
}

static int step(Instance *i, double now, double length) {
    double steps = round(length / STEP_S);
    if (!(steps >= 1.0 && steps <= MOST_STEPS) || fabs(length - steps * STEP_S) > 1e-6 * STEP_S)
        return refuse(i, "a step must be whole blocks, of a controller one block");
    for (double k = 0.0; k < steps; k++)
        if (KERNEL(i->memory)) return refuse(i, "the state is no number any more");
    *(double *)i->memory = now + length;
    return OK;
}

static int get_state(Instance *i, void **state) {
    if (!*state && !(*state = malloc(MEMORY_BYTES))) return refuse(i, "no memory");
    memcpy(*state, i->memory, MEMORY_BYTES);
    return OK;
}

static int set_state(Instance *i, const void *state) { return memcpy(i->memory, state, MEMORY_BYTES), OK; }
static int free_state(void **state) { return free(*state), *state = NULL, OK; }
static int write_state(Instance *i, const void *state, void *bytes, size_t size) {
    if (size != MEMORY_BYTES) return refuse(i, "the size of a state is that of SerializedFMUStateSize");
    return memcpy(bytes, state, size), OK;
}

static int read_state(Instance *i, const void *bytes, size_t size, void **state) {
    if (size != MEMORY_BYTES) return refuse(i, "the bytes are no state of this model");
    int status = get_state(i, state);
    if (status == OK) memcpy(*state, bytes, size);
    return status;
}
