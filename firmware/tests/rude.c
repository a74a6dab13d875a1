#include "rude_parts.h"

struct rude_state rude;
static struct monitor monitor;
static uint32_t lost_for, go_stale;
static bool stale_answer;

static struct sim_servo *victim(uint32_t k) { return &rude.sim.servo[(rude.run->k + k) % rude.sim.joints]; }

/* --- faults --- */

static void reset(uint32_t cause) {
    sim_reset(&rude.sim, rude.run->table, rude.run->size, cause);
    rude.sim.r.start_pressed = rude.pressed;
    rude.press_counts = false;
    rude.reset_at = rude_ms();
    rude.asked |= ASKED_RESET;
}

static void restart(struct sim_servo *v) {
    uint8_t *t = v->table;
    memset(t + DXL_TORQUE, 0, DXL_END - DXL_TORQUE);
    t[26] = t[27] = 1;
    t[28] = t[29] = 32;
    put16(t + DXL_TORQUE_LIMIT, 1023);
    put16(t + DXL_PUNCH, 32);
    put16(t + DXL_GOAL, (uint32_t)(v->milli / 1000));
    v->boots_until = rude_ms() + 100u + sim_random(&rude.sim, 300);
}

static void cut_the_answer(void) {
    if (rude.sim.answer_length > 1u) rude.sim.answer_length = 1u + sim_random(&rude.sim, rude.sim.answer_length - 1u);
}

static void put_before_the_answer(uint32_t n) {
    if (rude.sim.answer_length == 0 || rude.sim.answer_length + n > sizeof rude.sim.answer) return;
    for (uint32_t k = rude.sim.answer_length; k > 0; k--) rude.sim.answer[k - 1u + n] = rude.sim.answer[k - 1u];
    for (uint32_t k = 0; k < n; k++) rude.sim.answer[k] = (uint8_t)sim_random(&rude.sim, 256);
    rude.sim.answer_length += n;
}

/* Whether this transaction is one that goes wrong. */
static bool hit(uint32_t at) {
    if (rude.run->k == 0 || at < rude.run->k || rude.run->mode == RUDE_ONCE) return at == rude.run->k;
    return rude.run->mode == RUDE_FROM_THEN_ON || (at - rude.run->k) % (2u + rude.run->k % 40u) == 0;
}

/* Of this one transaction, after the servos have answered. */
static void spoil_answer(struct sim *s) {
    bool here = hit(s->transactions);
    if (stale_answer && s->answer_length) { /* the end of the one before comes first */
        stale_answer = false;
        put_before_the_answer(1u + sim_random(s, 12));
    }
    if (here && rude.run->fault == RUDE_TEN_LOST) lost_for = 10;
    if (lost_for) {
        lost_for--;
        s->answer_length = 0;
    }
    if (!here) return;
    if (rude.run->fault == RUDE_ANSWER_LOST || rude.run->fault == RUDE_LATE_ANSWER) s->answer_length = 0;
    if (rude.run->fault == RUDE_LATE_ANSWER) stale_answer = true;
    if (rude.run->fault == RUDE_STRAY_BYTES) put_before_the_answer(1u + sim_random(s, 7));
    if (rude.run->fault == RUDE_ANSWER_CUT) cut_the_answer();
    if (rude.run->fault == RUDE_ANSWER_FLIPPED && s->answer_length) s->answer[sim_random(s, s->answer_length)] ^= (uint8_t)(1u << sim_random(s, 8));
    if (rude.run->fault == RUDE_FIRST_BYTE_LOST && s->answer_length) {
        s->answer_length--;
        for (uint32_t k = 0; k < s->answer_length; k++) s->answer[k] = s->answer[k + 1u];
    }
}

static void to_all(void (*what)(struct sim_servo *), uint32_t every) {
    for (uint32_t j = 0; j < rude.sim.joints; j += every) what(&rude.sim.servo[j]);
}

static void unplug(struct sim_servo *v) { v->powered = false; v->table[DXL_TORQUE] = 0; }
static void late(struct sim_servo *v) { v->boots_until = rude_ms() + 50u + sim_random(&rude.sim, 700); }

static void servos_fail(uint32_t fault) {
    switch (fault) {
    case RUDE_UNPLUGGED: unplug(victim(0)); break;
    case RUDE_HALF_UNPLUGGED: to_all(unplug, 2); break;
    case RUDE_RESTARTED: restart(victim(0)); break;
    case RUDE_SUPPLY_DIP: to_all(restart, 1); break;
    case RUDE_SUPPLY_GONE: to_all(unplug, 1); break;
    case RUDE_LEVEL_1: victim(0)->level1 = victim(5)->level1 = true; break;
    case RUDE_TWIN: victim(0)->twin = true; break;
    case RUDE_HOT: victim(0)->heat = 72; break;
    case RUDE_OVERLOAD: victim(0)->overload = true; break;
    case RUDE_LOW: rude.sim.volts = 85; break;
    case RUDE_BABBLE: rude.sim.babble = true; break;
    case RUDE_BLOCKED: victim(0)->held = true; break;
    case RUDE_SLOW: rude.sim.jitter = 900; break;
    case RUDE_LATE_BOOT: to_all(late, 1); break;
    default: break;
    }
}

static void people_and_chip(uint32_t fault) {
    switch (fault) {
    case RUDE_WATCHDOG: reset(REASON_WATCHDOG); break;
    case RUDE_MODE: reset(REASON_RESET_PIN); break;
    case RUDE_HOT_AFTER_RESET:
        reset(REASON_WATCHDOG);
        victim(0)->heat = 72;
        break;
    case RUDE_BROWN_OUT: to_all(restart, 1); reset(REASON_BROWN_OUT); break;
    case RUDE_LINK_FLIPPED: rude.link_flip = true; break;
    case RUDE_LINK_CUT: rude.link_cut = true; break;
    case RUDE_STOP: rude_order(FRAME_STOP, ASKED_STOP); break;
    case RUDE_RELEASE: rude_order(FRAME_RELEASE, ASKED_RELEASE); break;
    case RUDE_PLAY: rude_order(FRAME_PLAY, ASKED_GO); break;
    case RUDE_REMOTE_1: rude_remote(REMOTE_1, ASKED_GO | ASKED_STOP); break;
    case RUDE_REMOTE_6: rude_remote(REMOTE_6, ASKED_RELEASE); break;
    case RUDE_TAP: rude_press(true); go_stale = rude_ms() + 60u; break;
    case RUDE_HELD: rude_press(true); go_stale = rude_ms() + 1600u; break;
    default: break;
    }
}

/* Packets that nobody hears, or hears wrongly. */
static void spoil_packet(struct sim *s) {
    bool first = s->transactions == rude.run->k;
    rude.run->injected = rude.run->injected || first;
    if (!hit(s->transactions)) return;
    if (rude.run->fault == RUDE_PACKET_LOST) s->r.bus.tx[0] = 0;
    if (rude.run->fault == RUDE_PACKET_FLIPPED) s->r.bus.tx[sim_random(s, s->r.bus.tx_length)] ^= (uint8_t)(1u << sim_random(s, 8));
    if (first) servos_fail(rude.run->fault);
}

/* --- one millisecond after the other --- */

static void what_the_monitor_sees(void) {
    bool spoiled = rude.run->injected && rude.run->mode == RUDE_FROM_THEN_ON;
    bool unreadable = spoiled && (rude.run->fault == RUDE_ANSWER_LOST || rude.run->fault == RUDE_ANSWER_FLIPPED || rude.run->fault == RUDE_ANSWER_CUT ||
                                  rude.run->fault == RUDE_LATE_ANSWER || rude.run->fault == RUDE_TEN_LOST);
    for (uint32_t j = 0; j < rude.sim.joints; j++) {
        struct sim_servo *v = &rude.sim.servo[j];
        struct monitor_joint *m = &monitor.joint[j];
        m->hears = v->powered && rude_ms() >= v->boots_until;
        m->answers = m->hears && !v->mute && !v->twin && !unreadable;
        m->torque = v->powered && v->table[DXL_TORQUE];
        m->hot = v->heat >= 65u;
        m->overloaded = v->overload;
        m->goal = get16(v->table + DXL_GOAL);
        m->speed = get16(v->table + DXL_SPEED);
        m->limit = get16(v->table + DXL_TORQUE_LIMIT);
    }
    monitor.deaf = rude.sim.babble || (spoiled && (rude.run->fault == RUDE_PACKET_LOST || rude.run->fault == RUDE_PACKET_FLIPPED));
    if (rude.pressed && rude.press_counts && rude_ms() - rude.held_from == 1500u) rude.asked |= ASKED_RELEASE;
    monitor_look(&monitor, rude_ms(), rude.asked);
    rude.asked = 0;
}

static bool answered(void) {
    uint8_t bytes[RING_BYTES];
    uint32_t n = sim_receive(&rude.sim, LINK_PC, bytes, sizeof bytes);
    for (uint32_t k = 0; k + 2u < n; k++)
        if (bytes[k] == 0xA5 && bytes[k + 1u] == 0x5A && bytes[k + 2u] == FRAME_STATE) return true;
    return false;
}

static void begin(struct rude_run *run) {
    rude.run = run;
    rude.asked = lost_for = rude.held_from = go_stale = rude.reset_at = 0;
    rude.link_cut = rude.link_flip = rude.pressed = rude.press_counts = stale_answer = false;
    sim_boot(&rude.sim, run->table, run->size, REASON_POWER_ON, run->seed);
    rude.sim.before = spoil_packet;
    rude.sim.after = spoil_answer;
    for (uint32_t j = 0; j < rude.sim.joints; j++) {
        monitor.joint[j].low = table_low(run->table, j);
        monitor.joint[j].high = table_high(run->table, j);
        monitor.joint[j].fastest = table_fastest(run->table, j);
        monitor.joint[j].neutral = table_neutral(run->table, j);
        monitor.joint[j].ramp = 45;  /* 30 deg/s */
        monitor.joint[j].half = 512;
        monitor.joint[j].near = 14;  /* by which a joint is lifted and let down */
    }
    monitor_begin(&monitor, rude.sim.joints, true);
    monitor.deaf = false;
    monitor.raw = run->session == RUDE_BRIDGED;
}

void rude_run(struct rude_run *run) {
    const struct step *s = rude_steps[run->session];
    bool done = false;
    begin(run);
    run->injected = run->asked_state_answered = false;
    for (bool last = false; !last;) {
        while (s->ms <= rude_ms() && !(s->ms == 6000u)) rude_act(s++);
        last = s->ms == 6000u && rude_ms() >= 6000u;
        if (!done && rude.sim.transactions >= run->k && run->k) {
            done = true;
            people_and_chip(run->fault);
        }
        if (go_stale && rude_ms() >= go_stale) {
            rude_press(false);
            go_stale = 0;
        }
        sim_run(&rude.sim, 1);
        what_the_monitor_sees();
        bool told = answered();
        run->asked_state_answered = run->asked_state_answered || (told && rude_ms() >= 5750u);
        if (monitor.rule) break;
    }
    run->transactions = rude.sim.transactions;
    run->rule = monitor.rule;
    run->rule_at = monitor.rule_at;
    run->rule_joint = monitor.rule_joint;
    run->state = rude.sim.r.state;
    run->reason = rude.sim.r.reason;
    run->ended_ms = rude_ms();
}
