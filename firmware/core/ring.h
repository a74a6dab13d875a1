/* Bytes between an interrupt and the main loop: one writes, one reads. */
#ifndef RING_H
#define RING_H

#include "bytes.h"

#define RING_BYTES 512u /* a power of two; 89 ms at 57,600 bit/s */

struct ring {
    uint8_t bytes[RING_BYTES];
    volatile uint32_t in, out; /* run on, never wrapped */
};

static inline uint32_t ring_used(const struct ring *r) { return r->in - r->out; }
static inline uint32_t ring_room(const struct ring *r) { return RING_BYTES - ring_used(r); }

static inline void ring_put(struct ring *r, uint8_t byte) {
    if (ring_room(r) == 0) return; /* frames carry their own sums: what is lost here is refused there */
    r->bytes[r->in % RING_BYTES] = byte;
    r->in++;
}

static inline uint8_t ring_get(struct ring *r) {
    uint8_t byte = r->bytes[r->out % RING_BYTES];
    r->out++;
    return byte;
}

#endif
