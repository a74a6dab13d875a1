/* Messages to the PC: state and reason when they change, and a log of the joints after each round. */
#include "robot.h"

void tell_state(struct robot *r) {
    uint8_t p[12];
    if (r->state == STATE_BRIDGE) {
        r->state_told = true; /* nothing of ours may come between the servos' answers */
        return;
    }
    put32(p, r->now);
    p[4] = r->state;
    p[5] = r->reason;
    p[6] = r->servo_named;
    p[7] = r->cause;
    p[8] = r->table_fault;
    p[9] = r->upload.accepted;
    put16(p + 10, r->battery);
    r->state_told = frame_send(&r->link[LINK_PC].tx, FRAME_STATE, 0, p, sizeof p);
}

#define SLOW_JOINTS 3u /* speed, load, voltage and heat change seldom in the servo: three joints' a frame, all in five frames */

void tell_log(struct robot *r) {
    uint8_t p[15u + 4u * MAX_JOINTS + 6u * SLOW_JOINTS], *at = p + 15;
    uint32_t answered = 0;
    for (uint32_t j = 0; j < r->joints; j++, at += 4) {
        answered |= (uint32_t)r->servo[j].fresh << j;
        r->servo[j].fresh = false;
        put16(at, r->goals[j]);
        put16(at + 2, r->servo[j].position);
    }
    for (uint32_t k = 0; k < SLOW_JOINTS; k++, at += 6) {
        const struct servo *s = &r->servo[(r->slow_turn + k) % r->joints];
        put16(at, s->present_speed);
        put16(at + 2, s->load);
        at[4] = s->volts;
        at[5] = s->heat;
    }
    put32(p, r->sweep_started);
    p[4] = (uint8_t)(r->now - r->sweep_started);
    p[5] = r->state;
    put16(p + 6, r->pose);
    p[8] = (uint8_t)r->slow_turn;
    put16(p + 9, r->battery);
    put32(p + 11, answered);
    if (frame_send(&r->link[LINK_PC].tx, FRAME_LOG, (uint8_t)r->joints, p, (uint32_t)(at - p)))
        r->slow_turn = (uint16_t)((r->slow_turn + SLOW_JOINTS) % r->joints);
}

#define BLINK_MS 256u /* a light is on, or off, for so long */

/* Whether a light that blinks a reason's number is on: first one blinks its tens, then the other its ones; again after 8 seconds. */
bool reason_light(uint8_t reason, uint32_t now, bool tens) {
    uint32_t slot = now / BLINK_MS % 32u, from = tens ? 0u : 8u, times = tens ? reason / 10u : reason % 10u;
    return slot >= from && (slot - from) % 2u == 0 && (slot - from) / 2u < times;
}
