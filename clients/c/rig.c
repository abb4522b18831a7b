/* A whole rig for the adapter `stream`: a light slider on a spring with LuGre friction; 20 kHz, blocks of 1 ms, a dead man.
 * cc -O2 -o rig rig.c -lm, and in the rig file: adapter = "stream", [device] command = ["./rig"]. With the argument `wait` each
 * block waits for its command, so that no clock is needed ([device] waits = true). */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <poll.h>
#include <time.h>

#include "stickslip_stream.h"

enum { SAMPLES = 20, CHANNELS = 5, STEPS = 5, DEAD_MAN_BLOCKS = 100 };
static const double PI = 3.14159265358979323846, DT_S = 1e-5, SLEW_M_PER_S = 1e-6, DRIVE_MPS = 5e-4;
static const double SPRING_N_PER_M = 11700, MASS_KG = 0.5, BRISTLE_N_PER_M = 2e7, COULOMB_N = 3.2, STATIC_N = 4.0, STRIBECK_MPS = 5e-4;

struct rig {
    double slide_m, slide_mps, bristle_m, drive_m, phase, amplitude_m;
    uint32_t noise;
};

/* Even noise from -1 to 1: a loop check refuses a sensor that never changes. */
static double noise(struct rig *r) {
    r->noise = r->noise * 1664525u + 1013904223u;
    return r->noise / 2147483648.0 - 1.0;
}

static void make_block(struct rig *r, const struct stream_command *c, float samples[SAMPLES][CHANNELS]) {
    double damping = 2 * sqrt(BRISTLE_N_PER_M * MASS_KG), omega = 2 * PI * c->frequency_Hz, accel = 0;
    double wanted_m = c->enable ? c->amplitude : 0;
    for (int i = 0; i < SAMPLES; i++) {
        for (int k = 0; k < STEPS; k++) {
            r->amplitude_m += fmin(fmax(wanted_m - r->amplitude_m, -SLEW_M_PER_S * DT_S), SLEW_M_PER_S * DT_S);
            r->phase = fmod(r->phase + omega * DT_S, 2 * PI);
            double relative_mps = r->slide_mps - r->amplitude_m * omega * cos(r->phase);
            double share = relative_mps / STRIBECK_MPS, level_N = COULOMB_N + (STATIC_N - COULOMB_N) * exp(-share * share);
            double rate_mps = relative_mps - BRISTLE_N_PER_M * fabs(relative_mps) * r->bristle_m / level_N;
            double friction_N = BRISTLE_N_PER_M * r->bristle_m + damping * rate_mps;
            accel = (SPRING_N_PER_M * (r->drive_m - r->slide_m) - friction_N) / MASS_KG;
            r->bristle_m += DT_S * rate_mps;
            r->slide_mps += DT_S * accel;
            r->slide_m += DT_S * r->slide_mps;
            r->drive_m += DT_S * DRIVE_MPS;
        }
        float *s = samples[i];
        s[0] = (float)(SPRING_N_PER_M * (r->drive_m - r->slide_m) + 0.02 * noise(r));
        s[1] = (float)(accel + 0.002 * noise(r));
        s[2] = (float)(-r->amplitude_m * omega * omega * sin(r->phase) + 0.002 * noise(r));
        s[3] = (float)(r->slide_m + 5e-7 * noise(r));
        s[4] = (float)(r->drive_m + 5e-7 * noise(r));
    }
}

int main(int count, char **arguments) {
    int waits = count > 1 && strcmp(arguments[1], "wait") == 0;
    struct rig rig = {.noise = 1};
    struct stream_reader reader = {0};
    struct stream_command command = {.frequency_Hz = 2600};
    float samples[SAMPLES][CHANNELS];
    unsigned silent_blocks = 0;
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (uint64_t number = 0;; number++) {
        struct pollfd input = {.fd = 0, .events = POLLIN};
        int found = 0;
        do {
            if (waits) poll(&input, 1, -1);
            found = stream_receive(0, &reader, &command);
            if (found < 0) return 0; /* who controls us is gone: the vibration ends with this process */
        } while (waits && !found);
        silent_blocks = found ? 0 : silent_blocks + 1;
        if (silent_blocks > DEAD_MAN_BLOCKS) command.amplitude = 0;
        make_block(&rig, &command, samples);
        if (!waits) {
            due.tv_nsec += 1000000;
            if (due.tv_nsec >= 1000000000) due.tv_nsec -= 1000000000, due.tv_sec++;
            while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, 0) == EINTR) continue;
        }
        if (stream_send(1, number, command.frequency_Hz, rig.amplitude_m, samples[0], SAMPLES * CHANNELS)) return 0;
    }
}
