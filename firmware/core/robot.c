/* States and their transitions. */
#include "robot.h"

void robot_init(struct robot *r, const uint8_t *built_in, uint32_t size, uint8_t cause) {
    memset(r, 0, sizeof *r);
    upload_init(&r->upload, built_in);
    r->cause = cause;
    r->state = cause == REASON_POWER_ON ? STATE_LIMP : STATE_STILL;
    r->table_fault = (uint8_t)table_check(built_in, size);
    if (r->table_fault) {
        enter(r, STATE_STILL, REASON_BAD_TABLE, 0xFF);
        return;
    }
    r->joints = table_joints(built_in);
    if (cause == REASON_POWER_ON)
        enter(r, STATE_CHECK, cause, 0xFF);
    else
        enter(r, STATE_STILL, cause, 0xFF);
}

void enter(struct robot *r, uint8_t state, uint8_t reason, uint8_t servo) {
    if (state == STATE_CHECK) r->came_from = r->state;
    r->entered = r->now;
    r->state = state;
    r->reason = reason;
    r->servo_named = servo;
    r->state_told = false;
    if (state == STATE_CHECK || state == STATE_LIMP || state == STATE_STILL) read_begin(r);
    if (state == STATE_CHECK) {
        r->check_for = STATE_RAMP;
        r->gentle = true;
    }
    if (state == STATE_NEUTRAL || state == STATE_LIMP) r->gentle = false;
    if (state == STATE_LIMP) release(r);
}

static void answer(struct robot *r) {
    r->bus.done = false;
    __asm volatile("" ::: "memory"); /* what an interrupt has put there is not looked at before */
    bus_align(&r->bus);
    if (r->state == STATE_BRIDGE)
        bridge_answer(r);
    else if (r->sending_read)
        read_answer(r);
    r->sending_read = false;
}

static void next(struct robot *r) {
    if (r->joints == 0) {
        if (r->send_release) motion_send(r);
        return;
    }
    if (r->state == STATE_BRIDGE) {
        bridge_send(r);
        return;
    }
    if (motion_send(r)) return;
    r->sending_read = read_next(r);
}

static void finish_upload(struct robot *r) {
    uint8_t result, payload[5];
    if (r->joints == 0 || !upload_step(&r->upload, r->now, &result)) return;
    payload[0] = FRAME_END;
    payload[1] = result;
    put16(payload + 2, r->upload.got);
    payload[4] = r->upload.sequence;
    frame_send(&r->link[r->upload.link].tx, FRAME_ANSWER, r->upload.number, payload, 5);
}

void robot_step(struct robot *r, uint32_t now) {
    r->now = now;
    if (!r->running) r->began = r->entered = now;
    r->running = true;
    if (r->bus.done) answer(r);
    if (r->ticked != now) {
        r->ticked = now;
        if (bus_free(&r->bus)) next(r); /* first of all: a pose that is due */
        commands_tick(r);
        judge_stray(r);
        if (r->state == STATE_BRIDGE) bridge_tick(r);
    }
    if (!r->bus.start && !reserved(r, 2)) { /* nothing long, as the sum of a frame, while a pose waits or is due at the next tick */
        commands_bytes(r);
        finish_upload(r);
        if (!r->state_told) tell_state(r);
    }
    if (bus_free(&r->bus)) next(r);
}
