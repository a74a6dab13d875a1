#include "frame.h"

#include "crc.h"

enum { FIRST, SECOND, TYPE, NUMBER, LENGTH, PAYLOAD, SUM_LOW, SUM_HIGH };

static bool feed_sum(struct frame_reader *r, uint8_t byte) {
    if (r->state == SUM_LOW) {
        r->sum = byte;
        r->state = SUM_HIGH;
        return false;
    }
    r->state = FIRST;
    return (r->sum | byte << 8) == r->crc;
}

static void feed_payload(struct frame_reader *r, uint8_t byte) {
    r->payload[r->got++] = byte;
    if (r->got == r->length) r->state = SUM_LOW;
}

static void feed_head(struct frame_reader *r, uint8_t byte) {
    if (r->state == TYPE) r->type = byte;
    if (r->state == NUMBER) r->number = byte;
    if (r->state == LENGTH) {
        r->length = byte;
        r->got = 0;
    }
    r->state++;
    if (r->state > LENGTH && r->length == 0) r->state = SUM_LOW;
    if (r->state > LENGTH && r->length > FRAME_PAYLOAD) r->state = FIRST;
}

void frame_reset(struct frame_reader *r) { r->state = FIRST; }

bool frame_feed(struct frame_reader *r, uint8_t byte) {
    switch (r->state) {
    case FIRST:
        if (byte == 0xA5) r->state = SECOND;
        r->crc = 0xFFFF;
        return false;
    case SECOND:
        r->state = byte == 0x5A ? TYPE : byte == 0xA5 ? SECOND : FIRST;
        return false;
    case SUM_LOW:
    case SUM_HIGH:
        return feed_sum(r, byte);
    default:
        r->crc = crc16(r->crc, byte);
        if (r->state == PAYLOAD)
            feed_payload(r, byte);
        else
            feed_head(r, byte);
        return false;
    }
}

bool frame_send(struct ring *to, uint8_t type, uint8_t number, const uint8_t *payload, uint32_t length) {
    uint8_t head[3] = {type, number, (uint8_t)length};
    uint16_t crc = 0xFFFF;
    if (ring_room(to) < length + FRAME_OVERHEAD) return false;
    ring_put(to, 0xA5);
    ring_put(to, 0x5A);
    for (uint32_t k = 0; k < length + 3u; k++) {
        uint8_t byte = k < 3u ? head[k] : payload[k - 3u];
        crc = crc16(crc, byte);
        ring_put(to, byte);
    }
    ring_put(to, (uint8_t)crc);
    ring_put(to, (uint8_t)(crc >> 8));
    return true;
}
