#include "rude.h"

#include "../core/crc.h"

/* One session at a time; callbacks find it here. */
static struct sim sim;
static struct monitor monitor;
static struct rude_run *now;
static uint32_t asked, lost_for, held_from, go_stale, reset_at;
static const uint8_t bytes_of_nothing[1];
static bool link_cut, link_flip, pressed, press_counts, stale_answer;

static struct sim_servo *victim(uint32_t k) { return &sim.servo[(now->k + k) % sim.joints]; }

static uint32_t ms(void) { return (uint32_t)(sim.us / 1000u); }

/* --- what people and the PC do --- */

static bool to_pc_link(const uint8_t *bytes, uint32_t n) {
    uint32_t at = sim_random(&sim, n);
    if (link_cut) return false;
    for (uint32_t k = 0; k < n; k++) {
        bool flip = link_flip && k == at;
        const uint8_t byte = (uint8_t)(bytes[k] ^ (flip ? 1u << sim_random(&sim, 8) : 0u));
        sim_put(&sim, LINK_PC, &byte, 1);
    }
    bool well = !link_flip;
    link_flip = false;
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

static void order(uint8_t type, uint32_t what) {
    if (frame(type, bytes_of_nothing, 0)) asked |= what;
}

static void remote(uint32_t buttons, uint32_t what) {
    uint8_t low = (uint8_t)buttons, high = (uint8_t)(buttons >> 8);
    uint8_t words[12] = {0xFF, 0x55, low, (uint8_t)~low, high, (uint8_t)~high, 0xFF, 0x55, 0, 0xFF, 0, 0xFF};
    sim_put(&sim, LINK_ZIGBEE, words, 12);
    asked |= what;
}

static void press(bool down) {
    if (!down && pressed && press_counts && ms() - held_from < 1490u) asked |= ASKED_GO; /* a tap starts, or stops, which is allowed as well */
    if (down) held_from = ms();
    if (down) press_counts = ms() - reset_at > 25u; /* one that is down when power comes is not believed */
    pressed = sim.r.start_pressed = down;
}

static void packet(uint8_t address, uint8_t width, const uint16_t *values) {
    uint8_t p[BUS_BYTES] = {0xFF, 0xFF, 0xFE, 0, 0x83, address, (uint8_t)(2u * width)};
    uint32_t n = 7;
    for (uint32_t j = 0; j < sim.joints; j++) {
        p[n++] = table_id(now->table, j);
        for (uint32_t w = 0; w < width; w++, n += 2u) put16(p + n, values[w]);
    }
    p[3] = (uint8_t)(n - 3u);
    uint8_t sum = 0;
    for (uint32_t k = 2; k < n; k++) sum = (uint8_t)(sum + p[k]);
    p[n++] = (uint8_t)~sum;
    if (to_pc_link(p, n)) asked |= ASKED_GO;
}

static void upload(void) {
    uint8_t p[FRAME_PAYLOAD];
    put32(p, now->second_size);
    put32(p + 4, crc32(0, now->second, now->second_size));
    p[8] = 1;
    p[9] = UPLOAD_RAMPS;
    frame(FRAME_BEGIN, p, 10);
}

static void upload_part(uint32_t at) {
    uint8_t p[FRAME_PAYLOAD];
    uint32_t n = now->second_size - at < 200u ? now->second_size - at : 200u;
    put16(p, at);
    memcpy(p + 2, now->second + at, n);
    frame(FRAME_DATA, p, (uint8_t)(n + 2u));
}

enum act { DO_PLAY, DO_STOP, DO_RELEASE, DO_ASK, DO_U, DO_ONE, DO_SIX, DO_DOWN, DO_UP, DO_BEGIN, DO_PART, DO_END, DO_BRIDGE, DO_LIMITS, DO_GOALS };
struct step { uint16_t ms; uint8_t act, argument; };

static const struct step steps[RUDE_SESSIONS][13] = {
    {{1700, DO_PLAY, 0}, {3000, DO_STOP, 0}, {5000, DO_RELEASE, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_RELEASE, 0}, {1900, DO_BEGIN, 0}, {1920, DO_PART, 0}, {1980, DO_PART, 1}, {2040, DO_PART, 2}, {2100, DO_END, 0}, {2200, DO_PLAY, 0},
     {4000, DO_PLAY, 0}, {5200, DO_RELEASE, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_U, 0}, {3000, DO_ONE, 0}, {5000, DO_SIX, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_DOWN, 0}, {1760, DO_UP, 0}, {2800, DO_DOWN, 0}, {4500, DO_UP, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_RELEASE, 0}, {1900, DO_BRIDGE, 0}, {2000, DO_LIMITS, 0}, {2060, DO_GOALS, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}},
    {{1700, DO_PLAY, 0}, {5500, DO_RELEASE, 0}, {5750, DO_ASK, 0}, {5880, DO_ASK, 0}, {6000, 0, 0}}};

static void act(const struct step *s) {
    static const uint16_t half[1] = {512}, there[2] = {512, 40};
    switch (s->act) {
    case DO_PLAY: order(FRAME_PLAY, ASKED_GO); break;
    case DO_STOP: order(FRAME_STOP, ASKED_STOP); break;
    case DO_RELEASE: order(FRAME_RELEASE, ASKED_RELEASE); break;
    case DO_ASK: order(FRAME_ASK, 0); break;
    case DO_U: remote(REMOTE_U, ASKED_GO); break;
    case DO_ONE: remote(REMOTE_1, ASKED_GO | ASKED_STOP); break;
    case DO_SIX: remote(REMOTE_6, ASKED_RELEASE); break;
    case DO_DOWN: press(true); break;
    case DO_UP: press(false); break;
    case DO_BEGIN: upload(); break;
    case DO_PART: upload_part(200u * s->argument); break;
    case DO_END: order(FRAME_END, 0); break;
    case DO_BRIDGE: order(FRAME_BRIDGE, 0); break;
    case DO_LIMITS: packet(34, 1, half); break;
    default: packet(30, 2, there); break;
    }
}

/* --- what goes wrong --- */

static void reset(uint32_t cause) {
    sim_reset(&sim, now->table, now->size, cause);
    sim.r.start_pressed = pressed;
    press_counts = false;
    reset_at = ms();
    asked |= ASKED_RESET;
}

static void restart(struct sim_servo *v) {
    uint8_t *t = v->table;
    memset(t + DXL_TORQUE, 0, DXL_END - DXL_TORQUE);
    t[26] = t[27] = 1;
    t[28] = t[29] = 32;
    put16(t + DXL_TORQUE_LIMIT, 1023);
    put16(t + DXL_PUNCH, 32);
    put16(t + DXL_GOAL, (uint32_t)(v->milli / 1000));
    v->boots_until = ms() + 100u + sim_random(&sim, 300);
}

static void cut_the_answer(void) {
    if (sim.answer_length > 1u) sim.answer_length = 1u + sim_random(&sim, sim.answer_length - 1u);
}

static void put_before_the_answer(uint32_t n) {
    if (sim.answer_length == 0 || sim.answer_length + n > sizeof sim.answer) return;
    for (uint32_t k = sim.answer_length; k > 0; k--) sim.answer[k - 1u + n] = sim.answer[k - 1u];
    for (uint32_t k = 0; k < n; k++) sim.answer[k] = (uint8_t)sim_random(&sim, 256);
    sim.answer_length += n;
}

/* Whether this transaction is one that goes wrong. */
static bool hit(uint32_t at) {
    if (now->k == 0 || at < now->k || now->mode == RUDE_ONCE) return at == now->k;
    return now->mode == RUDE_FROM_THEN_ON || (at - now->k) % (2u + now->k % 40u) == 0;
}

/* Of this one transaction, after the servos have answered. */
static void spoil_answer(struct sim *s) {
    bool here = hit(s->transactions);
    if (stale_answer && s->answer_length) { /* the end of the one before comes first */
        stale_answer = false;
        put_before_the_answer(1u + sim_random(s, 12));
    }
    if (here && now->fault == RUDE_TEN_LOST) lost_for = 10;
    if (lost_for) {
        lost_for--;
        s->answer_length = 0;
    }
    if (!here) return;
    if (now->fault == RUDE_ANSWER_LOST || now->fault == RUDE_LATE_ANSWER) s->answer_length = 0;
    if (now->fault == RUDE_LATE_ANSWER) stale_answer = true;
    if (now->fault == RUDE_STRAY_BYTES) put_before_the_answer(1u + sim_random(s, 7));
    if (now->fault == RUDE_ANSWER_CUT) cut_the_answer();
    if (now->fault == RUDE_ANSWER_FLIPPED && s->answer_length) s->answer[sim_random(s, s->answer_length)] ^= (uint8_t)(1u << sim_random(s, 8));
    if (now->fault == RUDE_FIRST_BYTE_LOST && s->answer_length) {
        s->answer_length--;
        for (uint32_t k = 0; k < s->answer_length; k++) s->answer[k] = s->answer[k + 1u];
    }
}

static void to_all(void (*what)(struct sim_servo *), uint32_t every) {
    for (uint32_t j = 0; j < sim.joints; j += every) what(&sim.servo[j]);
}

static void unplug(struct sim_servo *v) { v->powered = false; v->table[DXL_TORQUE] = 0; }
static void late(struct sim_servo *v) { v->boots_until = ms() + 50u + sim_random(&sim, 700); }

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
    case RUDE_LOW: sim.volts = 85; break;
    case RUDE_BABBLE: sim.babble = true; break;
    case RUDE_BLOCKED: victim(0)->held = true; break;
    case RUDE_SLOW: sim.jitter = 900; break;
    case RUDE_LATE_BOOT: to_all(late, 1); break;
    default: break;
    }
}

static void people_and_chip(uint32_t fault) {
    switch (fault) {
    case RUDE_WATCHDOG: reset(REASON_WATCHDOG); break;
    case RUDE_MODE: reset(REASON_RESET_PIN); break;
    case RUDE_BROWN_OUT: to_all(restart, 1); reset(REASON_BROWN_OUT); break;
    case RUDE_LINK_FLIPPED: link_flip = true; break;
    case RUDE_LINK_CUT: link_cut = true; break;
    case RUDE_STOP: order(FRAME_STOP, ASKED_STOP); break;
    case RUDE_RELEASE: order(FRAME_RELEASE, ASKED_RELEASE); break;
    case RUDE_PLAY: order(FRAME_PLAY, ASKED_GO); break;
    case RUDE_REMOTE_1: remote(REMOTE_1, ASKED_GO | ASKED_STOP); break;
    case RUDE_REMOTE_6: remote(REMOTE_6, ASKED_RELEASE); break;
    case RUDE_TAP: press(true); go_stale = ms() + 60u; break;
    case RUDE_HELD: press(true); go_stale = ms() + 1600u; break;
    default: break;
    }
}

/* Packets that nobody hears, or hears wrongly. */
static void spoil_packet(struct sim *s) {
    bool first = s->transactions == now->k;
    now->injected = now->injected || first;
    if (!hit(s->transactions)) return;
    if (now->fault == RUDE_PACKET_LOST) s->r.bus.tx[0] = 0;
    if (now->fault == RUDE_PACKET_FLIPPED) s->r.bus.tx[sim_random(s, s->r.bus.tx_length)] ^= (uint8_t)(1u << sim_random(s, 8));
    if (first) servos_fail(now->fault);
}

/* --- one millisecond after the other --- */

static void what_the_monitor_sees(void) {
    bool spoiled = now->injected && now->mode == RUDE_FROM_THEN_ON;
    bool unreadable = spoiled && (now->fault == RUDE_ANSWER_LOST || now->fault == RUDE_ANSWER_FLIPPED || now->fault == RUDE_ANSWER_CUT ||
                                  now->fault == RUDE_LATE_ANSWER || now->fault == RUDE_TEN_LOST);
    for (uint32_t j = 0; j < sim.joints; j++) {
        struct sim_servo *v = &sim.servo[j];
        struct monitor_joint *m = &monitor.joint[j];
        m->hears = v->powered && ms() >= v->boots_until;
        m->answers = m->hears && !v->mute && !v->twin && !unreadable;
        m->torque = v->powered && v->table[DXL_TORQUE];
        m->hot = v->heat >= 65u;
        m->overloaded = v->overload;
        m->goal = get16(v->table + DXL_GOAL);
        m->speed = get16(v->table + DXL_SPEED);
        m->limit = get16(v->table + DXL_TORQUE_LIMIT);
    }
    monitor.deaf = sim.babble || (spoiled && (now->fault == RUDE_PACKET_LOST || now->fault == RUDE_PACKET_FLIPPED));
    if (pressed && press_counts && ms() - held_from == 1510u) asked |= ASKED_RELEASE;
    monitor_look(&monitor, ms(), asked);
    asked = 0;
}

static bool answered(void) {
    uint8_t bytes[RING_BYTES];
    uint32_t n = sim_receive(&sim, LINK_PC, bytes, sizeof bytes);
    for (uint32_t k = 0; k + 2u < n; k++)
        if (bytes[k] == 0xA5 && bytes[k + 1u] == 0x5A && bytes[k + 2u] == FRAME_STATE) return true;
    return false;
}

static void begin(struct rude_run *run) {
    now = run;
    asked = lost_for = held_from = go_stale = reset_at = 0;
    link_cut = link_flip = pressed = press_counts = stale_answer = false;
    sim_boot(&sim, run->table, run->size, REASON_POWER_ON, run->seed);
    sim.before = spoil_packet;
    sim.after = spoil_answer;
    for (uint32_t j = 0; j < sim.joints; j++) {
        monitor.joint[j].low = table_low(run->table, j);
        monitor.joint[j].high = table_high(run->table, j);
        monitor.joint[j].fastest = table_fastest(run->table, j);
        monitor.joint[j].neutral = table_neutral(run->table, j);
    }
    monitor_begin(&monitor, sim.joints, true);
    monitor.deaf = false;
    monitor.raw = run->session == RUDE_BRIDGED;
}

void rude_run(struct rude_run *run) {
    const struct step *s = steps[run->session];
    bool done = false;
    begin(run);
    run->injected = run->asked_state_answered = false;
    for (bool last = false; !last;) {
        while (s->ms <= ms() && !(s->ms == 6000u)) act(s++);
        last = s->ms == 6000u && ms() >= 6000u;
        if (!done && sim.transactions >= run->k && run->k) {
            done = true;
            people_and_chip(run->fault);
        }
        if (go_stale && ms() >= go_stale) {
            press(false);
            go_stale = 0;
        }
        sim_run(&sim, 1);
        what_the_monitor_sees();
        bool told = answered();
        run->asked_state_answered = run->asked_state_answered || (told && ms() >= 5750u);
        if (monitor.rule) break;
    }
    run->transactions = sim.transactions;
    run->rule = monitor.rule;
    run->rule_at = monitor.rule_at;
    run->rule_joint = monitor.rule_joint;
    run->state = sim.r.state;
    run->reason = sim.r.reason;
    run->ended_ms = ms();
}
