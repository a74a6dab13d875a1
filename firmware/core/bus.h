/* One transaction on the servo bus at a time. The core asks, the chip carries out and says when it is over. */
#ifndef BUS_H
#define BUS_H

#include "bytes.h"

#define BUS_BYTES 144u

struct bus {
    uint8_t tx[BUS_BYTES], rx[BUS_BYTES];
    uint16_t tx_length, expected; /* bytes to send, bytes of the answer (0: none) */
    uint16_t rx_length;           /* what came, set by the chip with `done` */
    bool start;                   /* core to chip: send now */
    bool busy;                    /* chip: under way */
    bool done;                    /* chip to core: over */
    uint8_t timeout_ms;
    uint32_t since;               /* tick at which it was asked for */
    uint32_t stray;               /* bytes that nobody asked for, counted by the chip */
};

static inline bool bus_free(const struct bus *b) { return !b->start && !b->busy && !b->done; }

static inline void bus_ask(struct bus *b, uint32_t length, uint32_t expected, uint8_t timeout_ms, uint32_t now) {
    b->tx_length = (uint16_t)length;
    b->expected = (uint16_t)expected;
    b->timeout_ms = timeout_ms;
    b->since = now;
    b->start = true;
}

/* Whether the chip should stop waiting for the answer. */
static inline bool bus_expired(const struct bus *b, uint32_t now) { return b->busy && now - b->since >= b->timeout_ms; }

#endif
