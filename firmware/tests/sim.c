#include "sim.h"

#include "../core/crc.h"

#define HEAT_LIMIT 11u /* register */

uint32_t sim_random(struct sim *s, uint32_t below) {
    s->rng ^= s->rng << 13;
    s->rng ^= s->rng >> 7;
    s->rng ^= s->rng << 17;
    return (uint32_t)(s->rng >> 16) % below;
}

static void power_on(struct sim_servo *v) {
    memset(v->table + DXL_TORQUE, 0, DXL_END - DXL_TORQUE);
    v->table[26] = v->table[27] = 1;
    v->table[28] = v->table[29] = 32;
    put16(v->table + DXL_TORQUE_LIMIT, 1023);
    put16(v->table + DXL_PUNCH, 32);
    put16(v->table + DXL_GOAL, (uint32_t)(v->milli / 1000));
    v->powered = true;
}

void sim_boot(struct sim *s, const uint8_t *table, uint32_t size, uint32_t cause, uint64_t seed) {
    memset(s, 0, sizeof *s);
    s->rng = seed * 0x9E3779B97F4A7C15u + 88172645463325252u;
    s->volts = 111;
    s->joints = table_check(table, size) ? 0 : table_joints(table);
    for (uint32_t j = 0; j < s->joints; j++) {
        struct sim_servo *v = &s->servo[j];
        v->milli = 1000 * (int64_t)(table_neutral(table, j) - 40u + sim_random(s, 80));
        v->heat = 30;
        v->table[HEAT_LIMIT] = 70;
        put16(v->table + DXL_MAX_TORQUE, 1023);
        v->table[DXL_ID] = table_id(table, j);
        put16(v->table + DXL_MODEL, table_model(table, j));
        put16(v->table + DXL_CW_LIMIT, table_low(table, j));
        put16(v->table + DXL_CCW_LIMIT, table_high(table, j));
        power_on(v);
    }
    sim_reset(s, table, size, cause);
}

void sim_reset(struct sim *s, const uint8_t *table, uint32_t size, uint32_t cause) {
    robot_init(&s->r, table, size, (uint8_t)cause);
    s->r.ticked = UINT32_MAX;
    s->state_seen = 0xFF;
}

static void note(struct sim *s, uint8_t kind) {
    if (s->events >= SIM_EVENTS) return;
    s->log[s->events++] = (struct sim_event){s->us, kind, s->r.state, s->r.reason, s->r.servo_named, (uint16_t)s->r.pose, s->r.resends};
}

/* --- servos --- */

static void store(struct sim *s, struct sim_servo *v, uint32_t address, const uint8_t *values, uint32_t n) {
    if (address + n > DXL_END || address < DXL_TORQUE || (address + n > DXL_POSITION && address < DXL_LOCK)) return;
    if (address <= DXL_GOAL && address + n >= DXL_GOAL + 2u) {
        uint32_t goal = get16(values + (DXL_GOAL - address));
        if (goal < get16(v->table + DXL_CW_LIMIT) || goal > get16(v->table + DXL_CCW_LIMIT)) return;
        v->table[DXL_TORQUE] = 1;
        for (uint32_t j = 0; j < s->joints && s->r.state != STATE_BRIDGE; j++)
            if (&s->servo[j] == v && (goal < table_low(playing(&s->r), j) || goal > table_high(playing(&s->r), j))) s->goal_errors++;
    }
    memcpy(v->table + address, values, n);
}

static void sense(struct sim *s, struct sim_servo *v) {
    put16(v->table + DXL_POSITION, (uint32_t)(v->milli / 1000) - v->hangs);
    v->table[DXL_VOLTS] = (uint8_t)(s->volts - v->drop);
    v->table[DXL_HEAT] = v->heat;
}

static void spoil(struct sim *s) {
    uint8_t *a = s->answer;
    uint32_t n = s->answer_length;
    uint8_t what = s->glitch;
    if (!what || n < 20u) return;
    s->glitch = 0;
    if (what == 1) s->answer_length = 0;
    if (what == 2) a[5 + DXL_HEAT - DXL_TORQUE] = 80;
    if (what == 3) a[5 + DXL_VOLTS - DXL_TORQUE] = 50;
    if (what == 4) a[4] = DXL_ERROR_OVERLOAD;
    if (what == 5) a[sim_random(s, n)] ^= (uint8_t)(1u << sim_random(s, 8));
    else a[n - 1u] = dxl_sum(a, n);
}

static void reply(struct sim *s, struct sim_servo *v, const uint8_t *parameters, uint32_t n) {
    uint8_t error = (uint8_t)((v->heat >= v->table[HEAT_LIMIT] ? DXL_ERROR_HEAT : 0) | (v->overload ? DXL_ERROR_OVERLOAD : 0));
    if (error) put16(v->table + DXL_TORQUE_LIMIT, 0);
    if (v->mute) return;
    uint8_t *a = s->answer;
    a[0] = a[1] = 0xFF;
    a[2] = v->table[DXL_ID];
    a[3] = (uint8_t)(n + 2u);
    a[4] = error;
    if (n) memcpy(a + 5, parameters, n);
    a[5 + n] = dxl_sum(a, n + DXL_OVERHEAD);
    s->answer_length = n + DXL_OVERHEAD;
    if (v->twin) a[5 + sim_random(s, n + 1u)] ^= (uint8_t)(1u + sim_random(s, 255));
    spoil(s);
    s->answer_length -= v->lacks;
    for (uint32_t k = 0; v->lacks && k < s->answer_length; k++) a[k] = a[k + v->lacks];
    for (uint32_t k = s->answer_length; v->lead && k > 0; k--) a[k - 1u + v->lead] = a[k - 1u];
    for (uint32_t k = 0; k < v->lead; k++) a[k] = (uint8_t)(k % 2u ? 0xFF : sim_random(s, 256));
    s->answer_length += v->lead;
    for (uint32_t k = 0; k < s->answer_length; k++)
        if (s->flip_from && sim_random(s, 1000000) < s->flip_from) a[k] ^= (uint8_t)(1u << sim_random(s, 8));
}

static void sync_write(struct sim *s, const uint8_t *p, uint32_t parameters) {
    uint32_t n = p[6];
    for (uint32_t k = 2; n && k + n < parameters; k += n + 1u)
        for (uint32_t j = 0; j < s->joints; j++)
            if (s->servo[j].powered && s->us / 1000u >= s->servo[j].boots_until && s->servo[j].table[DXL_ID] == p[5 + k]) store(s, &s->servo[j], p[5], p + 6 + k, n);
}

/* The servos' reaction to the packet that was sent. */
static void hear(struct sim *s) {
    uint8_t p[BUS_BYTES];
    uint32_t n = s->r.bus.tx_length;
    memcpy(p, s->r.bus.tx, n);
    s->answer_length = 0;
    for (uint32_t k = 0; k < n; k++)
        if (s->flip_to && sim_random(s, 1000000) < s->flip_to) p[k] ^= (uint8_t)(1u << sim_random(s, 8));
    if (s->babble || p[0] != 0xFF || p[1] != 0xFF || p[3] + 4u != n || dxl_sum(p, n) != p[n - 1u]) return;
    if (p[4] == DXL_SYNC_WRITE) sync_write(s, p, n - DXL_OVERHEAD);
    for (uint32_t j = 0; j < s->joints; j++) {
        struct sim_servo *v = &s->servo[j];
        if (!v->powered || s->us / 1000u < v->boots_until || (p[2] != v->table[DXL_ID] && p[2] != DXL_BROADCAST)) continue;
        if (p[4] == DXL_WRITE) store(s, v, p[5], p + 6, n - DXL_OVERHEAD - 1u);
        if (p[2] == DXL_BROADCAST) continue;
        sense(s, v);
        if (p[4] == DXL_READ && p[5] + p[6] <= (int)DXL_END) reply(s, v, v->table + p[5], p[6]);
        else if (p[4] <= DXL_RESET && !v->level1) reply(s, v, NULL, 0);
    }
}

static void move(struct sim *s) {
    for (uint32_t j = 0; j < s->joints; j++) {
        struct sim_servo *v = &s->servo[j];
        if (!v->powered || v->held || !v->table[DXL_TORQUE] || !get16(v->table + DXL_TORQUE_LIMIT)) continue;
        int64_t goal = 1000 * (int64_t)get16(v->table + DXL_GOAL), speed = get16(v->table + DXL_SPEED);
        if (speed == 0 || speed > FASTEST_SPEED) speed = FASTEST_SPEED;
        int64_t step = speed * SPEED_MILLI / 1000, way = goal - v->milli; /* counts a second are thousandths a millisecond */
        v->milli += way > step ? step : way < -step ? -step : way;
    }
}

/* How long some servo's goal has not been the one that was meant. */
static void watch_goals(struct sim *s) {
    bool wrong = false;
    if (s->r.state == STATE_PLAY && s->r.pose > 0 && !s->r.send_goals)
        for (uint32_t j = 0; j < s->joints; j++)
            wrong = wrong || get16(s->servo[j].table + DXL_GOAL) != s->r.goals[j] || get16(s->servo[j].table + DXL_SPEED) != s->r.speeds[j];
    s->wrong_since = wrong ? s->wrong_since + 1u : 0;
    if (s->wrong_since > s->wrong_longest) s->wrong_longest = s->wrong_since;
}

/* --- bus and time --- */

static void begin_transaction(struct sim *s) {
    struct bus *b = &s->r.bus;
    b->start = false;
    b->busy = true;
    if (s->sent) s->sent(s);
    if (b->tx[4] == DXL_SYNC_WRITE) note(s, LOG_GOALS);
    if (b->tx[4] == DXL_SYNC_WRITE && s->r.state == STATE_PLAY && s->r.resends == 0) s->poses++;
    if (b->tx[4] == DXL_WRITE && b->tx[5] == DXL_TORQUE && b->tx[6] == 0) note(s, LOG_OFF);
    s->transactions++;
    if (s->before) s->before(s);
    hear(s);
    if (s->after) s->after(s);
    uint64_t sent = s->us + 10u * b->tx_length;
    if (s->babble && b->expected) {
        for (uint32_t k = 0; k < b->expected; k++) s->answer[k] = (uint8_t)sim_random(s, 256);
        s->answer_length = b->expected;
        s->busy_until = sent + 10u * b->expected;
    } else if (b->expected == 0) {
        s->busy_until = sent;
    } else if (s->answer_length >= b->expected) {
        s->busy_until = sent + 520u + sim_random(s, 131u + s->jitter) + 10u * s->answer_length;
    } else {
        s->busy_until = UINT64_MAX; /* the core's time-out ends it */
    }
}

static void end_transaction(struct sim *s) {
    struct bus *b = &s->r.bus;
    uint32_t n = s->answer_length < b->expected ? s->answer_length : b->expected;
    memcpy(b->rx, s->answer, n);
    if (n && n == b->expected) { /* as the chip's layer does */
        uint32_t more = bus_more(b);
        if (more > s->answer_length - n) more = s->answer_length - n;
        memcpy(b->rx + n, s->answer + n, more);
        n += more;
    }
    b->rx_length = (uint16_t)n;
    b->stray += s->answer_length - n;
    b->busy = false;
    b->done = true;
}

static void step(struct sim *s) {
    robot_step(&s->r, (uint32_t)(s->us / 1000u));
    if (s->r.state != s->state_seen) {
        s->state_seen = s->r.state;
        note(s, LOG_STATE);
    }
    if (s->r.bus.start) begin_transaction(s);
}

void sim_run(struct sim *s, uint32_t ms) {
    for (uint32_t k = 0; k < ms; k++) {
        uint64_t next = s->us + 1000u;
        if (bus_expired(&s->r.bus, (uint32_t)(s->us / 1000u))) end_transaction(s);
        step(s);
        while (s->r.bus.busy && s->busy_until < next) {
            s->us = s->busy_until;
            end_transaction(s);
            step(s);
        }
        s->us = next;
        if (s->babble && !s->r.bus.busy) s->r.bus.stray += 80;
        move(s);
        watch_goals(s);
    }
}

/* --- links --- */

void sim_send(struct sim *s, uint32_t link, const uint8_t *bytes, uint32_t n) {
    for (uint32_t k = 0; k < n; k++) {
        ring_put(&s->r.link[link].rx, bytes[k]);
        if (k % 6u == 5u) sim_run(s, 1); /* 57,600 bit/s: 5.8 bytes a millisecond */
    }
}

void sim_put(struct sim *s, uint32_t link, const uint8_t *bytes, uint32_t n) {
    for (uint32_t k = 0; k < n; k++) ring_put(&s->r.link[link].rx, bytes[k]);
}

uint32_t sim_receive(struct sim *s, uint32_t link, uint8_t *to, uint32_t most) {
    uint32_t n = 0;
    while (n < most && ring_used(&s->r.link[link].tx)) to[n++] = ring_get(&s->r.link[link].tx);
    return n;
}

void sim_frame(struct sim *s, uint32_t link, uint32_t type, const uint8_t *payload, uint32_t n) {
    static struct ring ring;
    uint8_t bytes[RING_BYTES];
    uint32_t k = 0;
    ring.in = ring.out = 0;
    static const uint8_t nothing;
    frame_send(&ring, (uint8_t)type, 1, payload ? payload : &nothing, n);
    while (ring_used(&ring)) bytes[k++] = ring_get(&ring);
    sim_send(s, link, bytes, k);
}

void sim_remote(struct sim *s, uint32_t buttons) {
    uint8_t low = (uint8_t)buttons, high = (uint8_t)(buttons >> 8);
    uint8_t p[6] = {0xFF, 0x55, low, (uint8_t)~low, high, (uint8_t)~high};
    sim_send(s, LINK_ZIGBEE, p, 6);
}
