/* Frames on the PC link and over ZigBee: A5 5A, type, number, length, payload, CRC-16 of type to payload. */
#ifndef FRAME_H
#define FRAME_H

#include "ring.h"

#define FRAME_PAYLOAD 204u
#define FRAME_OVERHEAD 7u

enum frame_type {
    FRAME_ASK = 0x01, FRAME_PLAY = 0x02, FRAME_STOP = 0x03, FRAME_RELEASE = 0x04, FRAME_BEGIN = 0x10, FRAME_DATA = 0x11,
    FRAME_END = 0x12, FRAME_BRIDGE = 0x20, FRAME_BRIDGE_END = 0x21,
    FRAME_STATE = 0x80, FRAME_ANSWER = 0x81, FRAME_LOG = 0x90
};

struct frame_reader {
    uint8_t type, number, length, payload[FRAME_PAYLOAD];
    uint8_t state, got;
    uint16_t crc, sum;
};

/* Takes one byte; true when a whole frame with a right sum has ended with it. */
bool frame_feed(struct frame_reader *r, uint8_t byte);

/* What came of a frame so far is none: the next byte begins one. */
void frame_reset(struct frame_reader *r);

/* Puts a frame with at most FRAME_PAYLOAD bytes into a ring, whole or not at all. */
bool frame_send(struct ring *to, uint8_t type, uint8_t number, const uint8_t *payload, uint32_t length);

#endif
