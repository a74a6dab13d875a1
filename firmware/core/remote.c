#include "remote.h"

#include "limits.h"

static uint16_t word(struct remote *r, uint16_t buttons, uint32_t now) {
    uint16_t pressed = 0;
    if (r->held != 0 && now - r->since <= REMOTE_MS && (buttons == r->held || buttons == 0) && r->acted != r->held)
        r->acted = pressed = r->held;
    if (buttons == 0) r->acted = 0;
    r->held = buttons;
    r->since = now;
    return pressed;
}

static bool fits(uint32_t count, uint8_t byte, uint8_t before) {
    if (count == 0) return byte == 0xFF;
    if (count == 1) return byte == 0x55;
    return count % 2u == 0 || (before ^ byte) == 0xFF;
}

uint16_t remote_feed(struct remote *r, uint8_t byte, uint32_t now) {
    uint8_t before = r->count ? r->got[r->count - 1u] : 0;
    if (!fits(r->count, byte, before)) {
        bool again = before == 0xFF && byte == 0x55; /* the header of the packet after a broken one */
        r->count = 0;
        if (again) r->got[r->count++] = 0xFF;
        else if (byte != 0xFF) return 0;
    }
    r->got[r->count++] = byte;
    if (r->count < 6u) return 0;
    r->count = 0;
    return word(r, (uint16_t)(r->got[2] | r->got[4] << 8), now);
}
