/* The table of reactions: one fault at a random moment of a walk, and the robot's reaction. */
#include "cells.h"

#include "../core/crc.h"

static void upload_part(struct sim *s, const uint8_t *table, uint32_t size, uint8_t sequence, uint32_t share, uint32_t crc) {
    uint8_t p[202];
    put32(p, size);
    put32(p + 4, crc);
    p[8] = sequence;
    p[9] = 0;
    sim_frame(s, LINK_PC, FRAME_BEGIN, p, 10);
    for (uint32_t at = 0; at < share; at += 200u) {
        uint32_t n = share - at < 200u ? share - at : 200u;
        put16(p, at);
        memcpy(p + 2, table + at, n);
        sim_frame(s, LINK_PC, FRAME_DATA, p, n + 2u);
    }
    if (share == size) sim_frame(s, LINK_PC, FRAME_END, NULL, 0);
}

static void foreign_upload(struct sim *s, const uint8_t *table, uint32_t size) {
    uint8_t other[TABLE_BYTES];
    memcpy(other, table, size);
    other[TABLE_HEAD] ^= 0x40; /* another bus ID */
    uint32_t crc = crc32(0, other, size - 4u);
    put32(other + size - 4u, crc);
    upload_part(s, other, size, 1, size, crc32(0, other, size));
}

static void reset(struct sim *s, const struct cell_run *c, uint32_t cause) {
    if (cause == REASON_BROWN_OUT)
        for (uint32_t j = 0; j < s->joints; j++) s->servo[j].table[DXL_TORQUE] = 0;
    sim_reset(s, c->table, c->size, cause);
}

static void single_glitches(struct sim *s) {
    for (uint8_t what = 1; what <= 5; what++) {
        s->glitch = what;
        sim_run(s, 150 + sim_random(s, 100));
    }
}

static void half_a_word(struct sim *s) {
    static const uint8_t start[3] = {0xFF, 0x55, 0x10};
    sim_send(s, LINK_ZIGBEE, start, 3); /* the radio is lost within the word that would stop */
}

static void inject(struct sim *s, const struct cell_run *c, struct sim_servo *one) {
    switch (c->fault) {
    case FAULT_SILENT: one->mute = true; break;
    case FAULT_TWIN: one->twin = true; break;
    case FAULT_MODEL: one->table[DXL_MODEL] ^= 0x1D; break;
    case FAULT_OVERLOAD: one->overload = true; break;
    case FAULT_HOT: one->heat = (uint8_t)(HOT_CELSIUS + sim_random(s, 10)); break;
    case FAULT_LOW_BATTERY: s->volts = (uint8_t)(LOW_DECIVOLT - 1u - sim_random(s, 20)); break;
    case FAULT_DEAD_SUPPLY:
        for (uint32_t j = 0; j < s->joints; j++) s->servo[j].mute = true;
        break;
    case FAULT_CHECKSUM: s->flip_from = 1000; break;
    case FAULT_BABBLE: s->babble = true; break;
    case FAULT_CUT_UPLOAD: upload_part(s, c->table, c->size, 1, c->size / 2u, crc32(0, c->table, c->size)); sim_frame(s, LINK_PC, FRAME_END, NULL, 0); break;
    case FAULT_FOREIGN_UPLOAD: foreign_upload(s, c->table, c->size); break;
    case FAULT_STALLED_UPLOAD: upload_part(s, c->table, c->size, 1, c->size / 3u, crc32(0, c->table, c->size)); break;
    case FAULT_RADIO: half_a_word(s); break;
    case FAULT_HELD: s->r.start_pressed = true; break;
    case FAULT_REMOTE_HELD:
        for (uint32_t k = 0; k < 20u; k++) sim_remote(s, REMOTE_U), sim_run(s, 40);
        break;
    case FAULT_PC_GONE: sim_send(s, LINK_PC, (const uint8_t *)"\xA5\x5A\x10", 3); break;
    case FAULT_BROWN_OUT: reset(s, c, REASON_BROWN_OUT); break;
    case FAULT_HANG: reset(s, c, REASON_WATCHDOG); break;
    case FAULT_GLITCHES: single_glitches(s); break;
    default: break;
    }
}

/* To neutral by the remote, then a walk of a random length, or a bridge. */
static bool under_way(struct sim *s, const struct cell_run *c) {
    for (uint32_t k = 0; k < 60u && s->r.state != STATE_NEUTRAL; k++) sim_run(s, 50);
    if (s->r.state != STATE_NEUTRAL) return false;
    if (c->fault == FAULT_PC_GONE_BRIDGE) {
        uint8_t p[BUS_BYTES];
        sim_frame(s, LINK_PC, FRAME_RELEASE, NULL, 0);
        sim_run(s, 100);
        sim_frame(s, LINK_PC, FRAME_BRIDGE, NULL, 0);
        uint32_t n = dxl_sync_goals(p, c->table, s->r.goals, s->r.speeds);
        sim_send(s, LINK_PC, p, n);
        sim_run(s, 20);
        return s->r.state == STATE_BRIDGE && s->servo[0].table[DXL_TORQUE] == 1;
    }
    sim_remote(s, REMOTE_U);
    sim_remote(s, 0);
    sim_run(s, 1 + sim_random(s, 2000));
    return s->r.state == STATE_PLAY;
}

static void watch(struct sim *s, struct cell_run *c, uint32_t from) {
    c->state = s->r.state;
    c->reason = s->r.reason;
    c->servo_named = s->r.servo_named;
    c->ramp_us = c->off_us = UINT64_MAX;
    for (uint32_t k = from; k < s->events; k++) {
        const struct sim_event *e = &s->log[k];
        uint64_t after = e->us - c->fault_us;
        if (e->kind == LOG_GOALS && e->state == STATE_YIELD && c->ramp_us == UINT64_MAX) c->ramp_us = after;
        if (e->kind == LOG_OFF && c->off_us == UINT64_MAX) c->off_us = after;
    }
    c->poses = s->poses;
    c->limp = 0;
    for (uint32_t j = 0; j < s->joints; j++) c->limp += !s->servo[j].table[DXL_TORQUE];
}

int cell_run(struct sim *s, struct cell_run *c) {
    sim_boot(s, c->table, c->size, REASON_POWER_ON, c->seed);
    if (!under_way(s, c)) return 1;
    c->servo = sim_random(s, s->joints);
    c->servo_id = table_id(c->table, c->servo);
    c->fault_us = s->us;
    uint32_t from = s->events, poses = s->poses;
    inject(s, c, &s->servo[c->servo]);
    sim_run(s, c->watch_ms);
    s->r.start_pressed = false;
    watch(s, c, from);
    c->poses -= poses;
    return 0;
}
