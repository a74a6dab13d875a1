/* The RC-100 remote: FF 55, low byte and its complement, high byte and its complement. */
#ifndef REMOTE_H
#define REMOTE_H

#include "bytes.h"

enum { REMOTE_U = 1, REMOTE_1 = 16, REMOTE_6 = 512 };

struct remote {
    uint8_t got[6], count;
    uint16_t held, acted;
    uint32_t since;
};

/* Takes one byte at `now` [ms]. Returns the buttons of a press that two packets have told: word and word, or word and release.
   A word that stays, as of a button held or stuck, is one press. */
uint16_t remote_feed(struct remote *r, uint8_t byte, uint32_t now);

#endif
