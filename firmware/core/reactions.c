/* Reactions to faults, as listed in docs/robot.md; a test goes through the cells of that table. */
#include "robot.h"

enum reaction reaction_of(uint8_t reason) {
    switch (reason) {
    case REASON_SILENT:
    case REASON_GARBLED:
    case REASON_WRONG_MODEL:
    case REASON_OVERLOAD:
    case REASON_HOT:
    case REASON_LOW_BATTERY:
    case REASON_GOAL_REFUSED:
    case REASON_BRIDGE_SILENT:
        return YIELD;
    case REASON_DEAD_SUPPLY:
    case REASON_BABBLE:
    case REASON_HELD:
    case REASON_IDLE:
    case REASON_NOT_ARRIVED:
        return RELEASE;
    default:
        return GO_ON;
    }
}

/* How a servo that is still starting appears. */
static bool nobody_hears(uint8_t reason) {
    return reason == REASON_SILENT || reason == REASON_GARBLED || reason == REASON_DEAD_SUPPLY || reason == REASON_BABBLE;
}

/* Where nothing is sent, servos may hold all the same: a ramp would be motion, so all that ends a walk lets go there. A person who holds
   START is obeyed in every state. */
void react(struct robot *r, uint8_t reason, uint8_t servo) {
    enum reaction what = reaction_of(reason);
    bool still = r->state == STATE_STILL;
    if (what == GO_ON || !(torque_on(r) || still || reason == REASON_HELD)) return;
    if (still && booting(r) && nobody_hears(reason)) return;
    if (what == RELEASE || still) {
        enter(r, STATE_LIMP, reason, servo);
    } else if (r->state != STATE_YIELD) {
        r->reason = reason;
        r->servo_named = servo;
        ramp_to_neutral(r, STATE_YIELD, STATE_LIMP);
    }
}

static void judge_supply(struct robot *r) {
    uint32_t low = 0, dead = 0, missed = 0, most = r->joints / 2u;
    for (uint32_t j = 0; j < r->joints; j++) {
        low += r->servo[j].volts < LOW_DECIVOLT;
        dead += r->servo[j].volts < DEAD_DECIVOLT;
        missed += r->servo[j].missed >= SUPPLY_ROUNDS;
    }
    r->low_rounds = (uint8_t)(low > most ? r->low_rounds + 1u : 0);
    r->dead_rounds = (uint8_t)(dead > most ? r->dead_rounds + 1u : 0);
    if (missed > most || r->dead_rounds >= ALARM_READINGS) react(r, REASON_DEAD_SUPPLY, 0xFF);
    if (r->low_rounds >= LOW_ROUNDS) {
        r->low_rounds = LOW_ROUNDS;
        react(r, REASON_LOW_BATTERY, 0xFF);
    }
}

/* After every round of readings. */
void judge_round(struct robot *r) {
    if (!torque_on(r) && r->state != STATE_STILL) return;
    judge_supply(r);
    for (uint32_t j = 0; j < r->joints && r->state != STATE_LIMP; j++) {
        const struct servo *s = &r->servo[j];
        uint8_t id = table_id(playing(r), j);
        bool silent = s->missed >= DEAD_ROUNDS || (s->missed >= SUPPLY_ROUNDS && r->now - s->heard >= DEAD_MS);
        if (silent) react(r, 2u * s->garbled >= s->missed ? REASON_GARBLED : REASON_SILENT, id);
        if (s->overloaded >= ALARM_READINGS) react(r, REASON_OVERLOAD, id);
        if (s->hot >= ALARM_READINGS) react(r, REASON_HOT, id);
    }
}

/* Every millisecond: bytes that nobody asked for. */
void judge_stray(struct robot *r) {
    if (r->now - r->stray_since < STRAY_WINDOW_MS) return;
    uint32_t heard = r->bus.stray - r->stray_seen;
    r->stray_seen = r->bus.stray;
    r->stray_since = r->now;
    r->stray_windows = (uint8_t)(heard >= STRAY_BYTES ? r->stray_windows + 1u : 0);
    if (r->stray_windows < STRAY_WINDOWS) return;
    r->stray_windows = 0;
    react(r, REASON_BABBLE, 0xFF);
}
