/* The PC talks to the servos through us: whole packets go to the bus, answers come back; silence ends it. */
#include "robot.h"

void bridge_begin(struct robot *r) {
    r->bridge.off = r->state == STATE_LIMP;
    enter(r, STATE_BRIDGE, REASON_LINK, 0xFF);
    r->bridge.got = 0;
    r->bridge.whole = r->bridge.asked = r->bridge.moved = false;
    r->bridge.heard = r->now;
    r->send_goals = r->send_release = false;
}

/* After silence: all servos are asked where they are, then a ramp to neutral and torque off, if anything was moved. */
void bridge_end(struct robot *r, uint8_t reason) {
    bool moved = r->bridge.moved;
    enter(r, moved ? STATE_CHECK : STATE_LIMP, reason, 0xFF);
    if (moved) r->check_for = STATE_YIELD;
}

void bridge_tick(struct robot *r) {
    if (r->bridge.off && !r->bridge.moved && r->now % OFF_AGAIN_MS == 0) r->send_release = true;
    if (r->now - r->bridge.heard >= BRIDGE_SILENCE_MS) bridge_end(r, REASON_BRIDGE_SILENT);
}

/* How many bytes the answer to this packet has. */
static uint32_t answer_length(const uint8_t *p) {
    if (p[2] == DXL_BROADCAST || p[4] == DXL_SYNC_WRITE) return 0;
    return DXL_OVERHEAD + (p[4] == DXL_READ && p[3] == 4u ? p[6] : 0u);
}

/* What would make all servos one, or unknown, is not passed on. */
static bool ruinous(const uint8_t *p) {
    if (p[2] != DXL_BROADCAST) return false;
    return p[4] == DXL_RESET || ((p[4] == DXL_WRITE || p[4] == DXL_REG_WRITE) && p[3] > 2u && p[5] <= DXL_ID + 1u);
}

static bool moves(const uint8_t *p) {
    if (p[4] == DXL_ACTION) return true;
    if (p[4] != DXL_WRITE && p[4] != DXL_REG_WRITE && p[4] != DXL_SYNC_WRITE) return false;
    uint32_t count = p[4] == DXL_SYNC_WRITE ? p[6] : p[3] - 3u;
    return p[5] <= DXL_SPEED && p[5] + count > DXL_TORQUE;
}

/* All bytes of a packet are there. Until it is sent no more are taken from the link. */
static void take(struct robot *r) {
    struct bridge *b = &r->bridge;
    bool right = dxl_sum(b->packet, b->got) == b->packet[b->got - 1u];
    if (right) b->heard = r->now;
    b->whole = right && !ruinous(b->packet) && answer_length(b->packet) <= BUS_BYTES;
    if (!b->whole) b->got = 0;
}

/* Called when the bus is free: any earlier packet has ended. */
void bridge_send(struct robot *r) {
    struct bridge *b = &r->bridge;
    if (!b->whole) {
        if (r->send_release) motion_send(r);
        return;
    }
    uint32_t n = b->got;
    b->got = 0;
    b->whole = false;
    b->asked = true;
    b->moved = b->moved || moves(b->packet);
    r->send_release = r->send_release && !b->moved;
    memcpy(r->bus.tx, b->packet, n);
    bus_ask(&r->bus, n, answer_length(b->packet), BRIDGE_TIMEOUT_MS, r->now);
}

void bridge_feed(struct robot *r, uint8_t byte) {
    struct bridge *b = &r->bridge;
    if (b->got < 2u && byte != 0xFF) {
        b->got = 0;
        return;
    }
    if (b->got == 2u && byte == 0xFF) return;
    b->packet[b->got++] = byte;
    if (b->got == 4u && (byte < 2u || byte + 4u > BUS_BYTES)) b->got = 0;
    if (b->got > 4u && b->got == b->packet[3] + 4u) take(r);
}

/* What answers a read of our own, asked before the bridge began, is none of the PC's. */
void bridge_answer(struct robot *r) {
    if (!r->bridge.asked) return;
    r->bridge.asked = false;
    for (uint32_t k = 0; k < r->bus.rx_length; k++) ring_put(&r->link[LINK_PC].tx, r->bus.rx[k]);
}
