/* A model of another author: a slide on a spring with LuGre friction, in mm and g, in steps of 0.5 ms. It shares no code with the
   plant. FMI 3 has the samples of a step as arrays, FMI 2 the last one. `fault` makes it fail after 1 s. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#if FMI == 2
#include "fmi2Functions.h"
#define SAMPLES 1
#define DO(name) fmi2##name
typedef fmi2Component Handle;
typedef fmi2Status Status;
#else
#include "fmi3Functions.h"
#define SAMPLES 10
#define DO(name) fmi3##name
typedef fmi3Instance Handle;
typedef fmi3Status Status;
#endif

enum { CARRIAGE_SPEED, TONE, STROKE, LOAD, FAULT, INPUTS, PULL = INPUTS, G_SLIDE, G_TABLE, X_SLIDE, X_CARRIAGE, OUTPUTS };

typedef struct {
    double in[INPUTS], out[OUTPUTS - INPUTS][SAMPLES];
    double t, x, v, z, rail, phase, a_table, a_slide; /* s, m */
} Model;

static void move(Model *m, double h) {
    double stroke = m->in[STROKE] * 1e-3, omega = 6.283185307179586 * m->in[TONE];
    m->phase += omega * h;
    double v_table = stroke * omega * cos(m->phase), a_table = -stroke * omega * omega * sin(m->phase);
    double rel = m->v - v_table, normal = 180.0 * m->in[LOAD];
    double level = normal * (0.08 + 0.016 * exp(-rel * rel / (0.0005 * 0.0005)));
    double stiffness = 2e7, damper = 1.2e4;
    double rate = rel - stiffness * fabs(rel) / level * m->z;
    m->z += rate * h;
    double friction = stiffness * m->z + damper * rate;
    m->rail += m->in[CARRIAGE_SPEED] * 1e-3 * h;
    double pull = 12000.0 * (m->rail - m->x);
    double a_slide = (pull - friction) / 1.5;
    m->v += a_slide * h;
    m->x += m->v * h;
    m->a_slide += (a_slide - m->a_slide) * fmin(1.0, 6.28 * 8000.0 * h);
    m->a_table += (a_table - m->a_table) * fmin(1.0, 6.28 * 8000.0 * h);
    m->t += h;
}

static Status step(Model *m, double length) {
    if (m->t > 1.0 && m->in[FAULT] == 1.0) *(volatile int *)0 = 1;
    while (m->t > 1.0 && m->in[FAULT] == 2.0) __asm__("");
    if (m->t > 1.0 && m->in[FAULT] == 3.0 && !malloc(1 << 22)) abort();
    if (m->t > 1.0 && m->in[FAULT] == 4.0) m->x = NAN;
    if (m->t > 1.0 && m->in[FAULT] == 5.0) return 3;
    for (int sample = 0; sample < SAMPLES; sample++) {
        int moves = (int)ceil(length / SAMPLES / 2.5e-6);
        for (int k = 0; k < moves; k++) move(m, length / SAMPLES / moves);
        double now[] = {12000.0 * (m->rail - m->x), m->a_slide / 9.80665, m->a_table / 9.80665, m->x * 1e3, m->rail * 1e3};
        for (int row = 0; row < OUTPUTS - INPUTS; row++) m->out[row][sample] = now[row];
    }
    return 0;
}

static Status get(Model *m, const unsigned r[], size_t n, double values[]) {
    for (size_t k = 0; k < n; k++) {
        if (r[k] >= OUTPUTS) return 3;
        if (r[k] < INPUTS) *values++ = m->in[r[k]];
        else memcpy(values, m->out[r[k] - INPUTS], sizeof m->out[0]), values += SAMPLES;
    }
    return 0;
}

static Status set(Model *m, const unsigned r[], size_t n, const double values[]) {
    for (size_t k = 0; k < n; k++)
        if (r[k] < INPUTS) m->in[r[k]] = values[k];
        else return 3;
    return 0;
}

static Handle made(void) {
    Model *m = calloc(1, sizeof *m);
    m->in[CARRIAGE_SPEED] = 0.5, m->in[TONE] = 4000.0, m->in[LOAD] = 1.0;
    return m;
}

void DO(FreeInstance)(Handle c) { free(c); }
Status DO(ExitInitializationMode)(Handle c) { return (void)c, 0; }
Status DO(Terminate)(Handle c) { return (void)c, 0; }
#if FMI == 2
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Component fmi2Instantiate(fmi2String n, fmi2Type t, fmi2String g, fmi2String r, const fmi2CallbackFunctions *f, fmi2Boolean v,
        fmi2Boolean l) { return made(); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean b, fmi2Real t, fmi2Real s, fmi2Boolean e, fmi2Real u) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) { return get(c, r, n, v); }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) { return set(c, r, n, v); }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real length, fmi2Boolean b) { return step(c, length); }
#else
const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String a, fmi3String b, fmi3String d, fmi3Boolean e, fmi3Boolean f, fmi3Boolean g,
        fmi3Boolean h, const fmi3ValueReference i[], size_t j, fmi3InstanceEnvironment k, fmi3LogMessageCallback l,
        fmi3IntermediateUpdateCallback m) { return made(); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean b, fmi3Float64 t, fmi3Float64 s, fmi3Boolean e, fmi3Float64 u) {
    return fmi3OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t l) { return get(c, r, n, v); }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t l) {
    return set(c, r, n, v);
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 now, fmi3Float64 length, fmi3Boolean f, fmi3Boolean *event, fmi3Boolean *terminate,
        fmi3Boolean *early, fmi3Float64 *reached) {
    *event = *terminate = *early = false;
    *reached = now + length;
    return step(c, length);
}
#endif
