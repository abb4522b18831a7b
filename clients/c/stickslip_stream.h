/* Frames of the adapter `stream` (docs/guides/write-an-adapter.md) for a device on a little-endian computer; POSIX. */
#ifndef STICKSLIP_STREAM_H
#define STICKSLIP_STREAM_H

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

struct stream_head {      /* before float samples[samples][channels] of a block; NaN: missing */
    char mark[4];         /* "SSR1" */
    uint32_t bytes;       /* after this field */
    uint64_t number;      /* of the block, from 0, without a gap */
    double frequency_Hz;  /* of the exciter at the block's end; NaN: unknown */
    double amplitude;
};

struct stream_command {
    char mark[4];         /* "SSC1" */
    uint32_t bytes;       /* 24 */
    double frequency_Hz;
    double amplitude;     /* 0: rest */
    uint32_t enable;      /* line of the amplifier */
    uint32_t toggle;      /* 0 and 1 in turn, for a watchdog */
};

struct stream_reader {    /* begin with all zeros */
    struct stream_command next;
    size_t have;
};

/* Take the newest command, if any, without waiting. Returns 1: a new command, 0: none, -1: who controls us is gone. */
static int stream_receive(int fd, struct stream_reader *reader, struct stream_command *command) {
    int found = 0;
    fcntl(fd, F_SETFL, fcntl(fd, F_GETFL, 0) | O_NONBLOCK);
    for (;;) {
        ssize_t got = read(fd, (char *)&reader->next + reader->have, sizeof reader->next - reader->have);
        if (got == 0) return -1;
        if (got < 0) return errno == EAGAIN || errno == EINTR ? found : -1;
        reader->have += (size_t)got;
        if (reader->have < sizeof reader->next) continue;
        reader->have = 0;
        if (memcmp(reader->next.mark, "SSC1", 4) != 0 || reader->next.bytes != sizeof reader->next - 8) return -1;
        *command = reader->next;
        found = 1;
    }
}

/* Send a block. Returns 0, or -1 if the receiver is gone. */
static int stream_send(int fd, uint64_t number, double frequency_Hz, double amplitude, const float *samples, size_t count) {
    struct stream_head head = {{'S', 'S', 'R', '1'}, 0, number, frequency_Hz, amplitude};
    const char *parts[2] = {(const char *)&head, (const char *)samples};
    size_t sizes[2] = {sizeof head, count * sizeof *samples};
    head.bytes = (uint32_t)(sizes[0] + sizes[1] - 8);
    for (int i = 0; i < 2; i++)
        for (size_t sent = 0; sent < sizes[i];) {
            ssize_t done = write(fd, parts[i] + sent, sizes[i] - sent);
            if (done < 0 && errno != EINTR) return -1;
            if (done > 0) sent += (size_t)done;
        }
    return 0;
}

#endif
