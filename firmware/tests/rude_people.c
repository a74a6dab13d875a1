/* What people and the PC do in a session. */
#include "../core/crc.h"
#include "rude_parts.h"

static const uint8_t bytes_of_nothing[1];

static bool to_pc_link(const uint8_t *bytes, uint32_t n) {
    uint32_t at = sim_random(&rude.sim, n);
    if (rude.link_cut) return false;
    for (uint32_t k = 0; k < n; k++) {
        bool flip = rude.link_flip && k == at;
        const uint8_t byte = (uint8_t)(bytes[k] ^ (flip ? 1u << sim_random(&rude.sim, 8) : 0u));
        sim_put(&rude.sim, LINK_PC, &byte, 1);
    }
    bool well = !rude.link_flip;
    rude.link_flip = false;
    return well;
}

static bool frame(uint8_t type, const uint8_t *payload, uint8_t n) {
    uint8_t bytes[FRAME_PAYLOAD + FRAME_OVERHEAD] = {0xA5, 0x5A, type, 1, n};
    uint16_t crc = 0xFFFF;
    for (uint32_t k = 0; k < n; k++) bytes[5 + k] = payload[k];
    for (uint32_t k = 2; k < 5u + n; k++) crc = crc16(crc, bytes[k]);
    put16(bytes + 5 + n, crc);
    return to_pc_link(bytes, n + FRAME_OVERHEAD);
}

void rude_order(uint8_t type, uint32_t what) {
    if (frame(type, bytes_of_nothing, 0)) rude.asked |= what;
}

void rude_remote(uint32_t buttons, uint32_t what) {
    uint8_t low = (uint8_t)buttons, high = (uint8_t)(buttons >> 8);
    uint8_t words[12] = {0xFF, 0x55, low, (uint8_t)~low, high, (uint8_t)~high, 0xFF, 0x55, 0, 0xFF, 0, 0xFF};
    sim_put(&rude.sim, LINK_ZIGBEE, words, 12);
    rude.asked |= what;
}

void rude_press(bool down) {
    if (!down && rude.pressed && rude.press_counts && rude_ms() - rude.held_from < 1490u) rude.asked |= ASKED_GO; /* a tap starts, or stops, which is allowed as well */
    if (down) rude.held_from = rude_ms();
    if (down) rude.press_counts = rude_ms() - rude.reset_at > 25u; /* one that is down when power comes is not believed */
    rude.pressed = rude.sim.r.start_pressed = down;
}

static void packet(uint8_t address, uint8_t width, const uint16_t *values) {
    uint8_t p[BUS_BYTES] = {0xFF, 0xFF, 0xFE, 0, 0x83, address, (uint8_t)(2u * width)};
    uint32_t n = 7;
    for (uint32_t j = 0; j < rude.sim.joints; j++) {
        p[n++] = table_id(rude.run->table, j);
        for (uint32_t w = 0; w < width; w++, n += 2u) put16(p + n, values[w]);
    }
    p[3] = (uint8_t)(n - 3u);
    uint8_t sum = 0;
    for (uint32_t k = 2; k < n; k++) sum = (uint8_t)(sum + p[k]);
    p[n++] = (uint8_t)~sum;
    if (to_pc_link(p, n)) rude.asked |= ASKED_GO;
}

static void upload(void) {
    uint8_t p[FRAME_PAYLOAD];
    put32(p, rude.run->second_size);
    put32(p + 4, crc32(0, rude.run->second, rude.run->second_size));
    p[8] = 1;
    p[9] = UPLOAD_RAMPS;
    frame(FRAME_BEGIN, p, 10);
}

static void upload_part(uint32_t at) {
    uint8_t p[FRAME_PAYLOAD];
    uint32_t n = rude.run->second_size - at < 200u ? rude.run->second_size - at : 200u;
    put16(p, at);
    memcpy(p + 2, rude.run->second + at, n);
    frame(FRAME_DATA, p, (uint8_t)(n + 2u));
}

const struct step rude_steps[RUDE_SESSIONS][13] = {
    {{1700, DO_PLAY, 0}, {3000, DO_STOP, 0}, {5000, DO_RELEASE, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_RELEASE, 0}, {1900, DO_BEGIN, 0}, {1920, DO_PART, 0}, {1980, DO_PART, 1}, {2040, DO_PART, 2}, {2100, DO_END, 0}, {2200, DO_PLAY, 0},
     {4000, DO_PLAY, 0}, {5200, DO_RELEASE, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_U, 0}, {3000, DO_ONE, 0}, {5000, DO_SIX, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_DOWN, 0}, {1760, DO_UP, 0}, {2800, DO_DOWN, 0}, {4500, DO_UP, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_RELEASE, 0}, {1900, DO_BRIDGE, 0}, {2000, DO_LIMITS, 0}, {2060, DO_GOALS, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_PLAY, 0}, {5500, DO_RELEASE, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}}};

void rude_act(const struct step *s) {
    static const uint16_t half[1] = {512}, there[2] = {512, 40};
    switch (s->act) {
    case DO_PLAY: rude_order(FRAME_PLAY, ASKED_GO); break;
    case DO_STOP: rude_order(FRAME_STOP, ASKED_STOP); break;
    case DO_RELEASE: rude_order(FRAME_RELEASE, ASKED_RELEASE); break;
    case DO_ASK: rude_order(FRAME_ASK, 0); break;
    case DO_U: rude_remote(REMOTE_U, ASKED_GO); break;
    case DO_ONE: rude_remote(REMOTE_1, ASKED_GO | ASKED_STOP); break;
    case DO_SIX: rude_remote(REMOTE_6, ASKED_RELEASE); break;
    case DO_DOWN: rude_press(true); break;
    case DO_UP: rude_press(false); break;
    case DO_BEGIN: upload(); break;
    case DO_PART: upload_part(200u * s->argument); break;
    case DO_END: rude_order(FRAME_END, 0); break;
    case DO_BRIDGE: rude_order(FRAME_BRIDGE, 0); break;
    case DO_LIMITS: packet(34, 1, half); break;
    default: packet(30, 2, there); break;
    }
}
