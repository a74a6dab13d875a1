/* One transaction on the servo bus at a time. The core asks, the chip carries out and says when it is over. */
#ifndef BUS_H
#define BUS_H

#include "bytes.h"

#define BUS_BYTES 144u

struct bus {
    uint8_t tx[BUS_BYTES], rx[BUS_BYTES];
    uint16_t tx_length, expected; /* bytes to send, bytes of the answer (0: none) */
    volatile uint16_t rx_length;  /* what came, set by the chip with `done` */
    volatile bool start;          /* core to chip: send now */
    volatile bool busy;           /* chip: under way */
    volatile bool done;           /* chip to core: over */
    uint8_t timeout_ms;
    uint32_t since;               /* tick at which it was asked for */
    volatile uint32_t stray;      /* bytes that nobody asked for, counted by the chip */
};

static inline bool bus_free(const struct bus *b) { return !b->start && !b->busy && !b->done; }

static inline void bus_ask(struct bus *b, uint32_t length, uint32_t expected, uint8_t timeout_ms, uint32_t now) {
    b->tx_length = (uint16_t)length;
    b->expected = (uint16_t)expected;
    b->timeout_ms = timeout_ms;
    b->since = now;
    b->start = true;
}

#define BUS_LEAD 8u /* stray bytes before an answer, as when the line turns round, that are looked through */

/* Where the answer of the servo that was asked begins among `n` bytes; 0 where no header is found. */
static inline uint32_t bus_lead(const struct bus *b, uint32_t n) {
    for (uint32_t k = 0; k <= BUS_LEAD && k + 2u < n; k++)
        if (b->rx[k] == 0xFF && b->rx[k + 1u] == 0xFF && b->rx[k + 2u] == b->tx[2]) return k;
    return 0;
}

/* How many bytes more have to come, `expected` being there: as many as are in front of the answer. */
static inline uint32_t bus_more(const struct bus *b) {
    uint32_t lead = bus_lead(b, b->expected);
    return b->expected + lead <= BUS_BYTES ? lead : 0;
}

/* The answer without stray bytes before it, and with the first byte of its header, which a line that turns round late swallows. */
static inline void bus_align(struct bus *b) {
    uint32_t lead = bus_lead(b, b->rx_length), n = b->rx_length;
    if (lead) {
        for (uint32_t k = lead; k < n; k++) b->rx[k - lead] = b->rx[k];
        b->rx_length = (uint16_t)(n - lead);
    } else if (n > 1u && n + 1u == b->expected && b->rx[0] == 0xFF && b->rx[1] == b->tx[2]) {
        for (uint32_t k = n; k > 0; k--) b->rx[k] = b->rx[k - 1u];
        b->rx_length++;
    }
}

/* Whether the chip should stop waiting for the answer. */
static inline bool bus_expired(const struct bus *b, uint32_t now) { return b->busy && now - b->since >= b->timeout_ms; }

#endif
