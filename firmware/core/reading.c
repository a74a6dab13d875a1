/* Servos are read in turn, all the time; before they get torque, twice and completely. */
#include "robot.h"

#define FIRST_READ DXL_TORQUE
#define READ_BYTES (DXL_END - FIRST_READ)

void read_begin(struct robot *r) {
    r->turn = r->tries = r->check_pass = 0;
    r->failed_row = r->garbled_row = 0;
    r->low_rounds = r->dead_rounds = 0;
    r->sweep_started = r->now;
    r->round_over = r->noise = r->send_blank = false;
    for (uint32_t j = 0; j < r->joints; j++) {
        struct servo *s = &r->servo[j];
        s->missed = s->garbled = s->hot = s->overloaded = 0;
        s->heard = r->now;
    }
}

/* Asks the servo whose turn it is; false in the pause between two rounds, and where servos that may wait for the rest of a packet, its
   length spoilt on the way, get that first. */
bool read_next(struct robot *r) {
    if (r->send_blank) {
        r->send_blank = false;
        bus_ask(&r->bus, dxl_blank(r->bus.tx, FLUSH_BYTES), 0, BUS_TIMEOUT_MS, r->now);
        return false;
    }
    if (r->round_over) {
        if (r->now - r->sweep_started < SWEEP_MS) return false;
        r->round_over = false;
        r->sweep_started = r->now;
    }
    bool whole = r->state == STATE_CHECK;
    uint8_t from = whole ? 0 : FIRST_READ, count = whole ? DXL_END : READ_BYTES;
    bus_ask(&r->bus, dxl_read(r->bus.tx, table_id(playing(r), r->turn), from, count), count + DXL_OVERHEAD, BUS_TIMEOUT_MS, r->now);
    return true;
}

static void keep(struct servo *s, const uint8_t *ram, uint8_t error, uint32_t now) {
    s->position = get16(ram + DXL_POSITION - FIRST_READ);
    s->present_speed = get16(ram + DXL_PRESENT_SPEED - FIRST_READ);
    s->load = get16(ram + DXL_LOAD - FIRST_READ);
    s->volts = ram[DXL_VOLTS - FIRST_READ];
    s->heat = ram[DXL_HEAT - FIRST_READ];
    s->error = error;
    s->missed = s->garbled = 0;
    s->heard = now;
    s->fresh = true;
}

static void count_alarms(struct servo *s, const uint8_t *ram) {
    bool hot = s->heat >= HOT_CELSIUS || (s->error & DXL_ERROR_HEAT);
    bool overloaded = (s->error & DXL_ERROR_OVERLOAD) || (!hot && get16(ram + DXL_TORQUE_LIMIT - FIRST_READ) == 0);
    s->hot = (uint8_t)(hot ? s->hot + (s->hot < 255u) : 0);
    s->overloaded = (uint8_t)(overloaded ? s->overloaded + (s->overloaded < 255u) : 0);
}

/* Has it the goal and speed that it was sent? If not, it gets them again, as do all: a lost Sync Write is lost to all. */
static void verify_goal(struct robot *r, uint32_t j, const uint8_t *ram) {
    struct servo *s = &r->servo[j];
    bool same = get16(ram + DXL_GOAL - FIRST_READ) == r->goals[j] && get16(ram + DXL_SPEED - FIRST_READ) == r->speeds[j];
    s->verified = same && ram[0] == 1;
    if (s->verified || r->send_goals) return;
    if (r->resends >= RESENDS) {
        react(r, REASON_GOAL_REFUSED, table_id(playing(r), j));
        return;
    }
    r->resends++;
    r->send_goals = true;
}

/* Restores margins, slopes and punch as they were when torque was switched on, and the present torque limit, where a broken packet or
   the first ramp has changed them. */
static void restore_settings(struct robot *r, uint32_t j, const uint8_t *ram) {
    const uint8_t *kept = r->servo[j].settings;
    uint8_t id = table_id(playing(r), j);
    const struct { uint8_t address, count, at; } part[2] = {{DXL_CW_MARGIN, 4, 0}, {DXL_PUNCH, 2, 4}};
    uint16_t limit = torque_limit(r, j), found = get16(ram + DXL_TORQUE_LIMIT - FIRST_READ);
    if (!r->servo[j].known) return;
    if (found != limit && found != 0) { /* 0 is the servo's own alarm */
        uint8_t value[2];
        put16(value, limit);
        bus_ask(&r->bus, dxl_write(r->bus.tx, id, DXL_TORQUE_LIMIT, value, 2), DXL_OVERHEAD, BUS_TIMEOUT_MS, r->now);
        return;
    }
    for (uint32_t k = 0; k < 2; k++)
        for (uint32_t i = 0; i < part[k].count; i++)
            if (ram[part[k].address - FIRST_READ + i] != kept[part[k].at + i]) {
                bus_ask(&r->bus, dxl_write(r->bus.tx, id, part[k].address, kept + part[k].at, part[k].count), DXL_OVERHEAD,
                        BUS_TIMEOUT_MS, r->now);
                return;
            }
}

static void keep_settings(struct servo *s, const uint8_t *all) {
    const uint8_t *ram = all + FIRST_READ;
    s->known = true;
    s->torque_limit = get16(all + DXL_MAX_TORQUE);
    for (uint32_t k = 0; k < 4; k++) s->settings[k] = ram[DXL_CW_MARGIN - FIRST_READ + k];
    for (uint32_t k = 0; k < 2; k++) s->settings[4 + k] = ram[DXL_PUNCH - FIRST_READ + k];
}

static void good(struct robot *r, uint32_t j, const uint8_t *ram, uint8_t error) {
    struct servo *s = &r->servo[j];
    keep(s, ram, error, r->now);
    count_alarms(s, ram);
    if (torque_on(r)) {
        verify_goal(r, j, ram);
        if (torque_on(r) && !reserved(r, POSE_GUARD_MS)) restore_settings(r, j, ram);
    } else if (r->state == STATE_LIMP) {
        s->off = ram[0] == 0;
        if (s->off) restore_settings(r, j, ram);
    }
}

/* What stands against torque in one servo's whole table, at its first and second reading. */
static uint8_t objection(const struct robot *r, uint32_t j, const uint8_t *all, uint8_t error) {
    const uint8_t *t = playing(r);
    const struct servo *s = &r->servo[j];
    if (get16(all + DXL_MODEL) != table_model(t, j)) return REASON_WRONG_MODEL;
    uint32_t cw = get16(all + DXL_CW_LIMIT), ccw = get16(all + DXL_CCW_LIMIT);
    if (cw > table_low(t, j) + LIMIT_SPREAD || ccw + LIMIT_SPREAD < table_high(t, j)) return REASON_NARROW_LIMITS;
    if (error & DXL_ERROR_OVERLOAD || get16(all + DXL_TORQUE_LIMIT) == 0) return REASON_OVERLOAD;
    if (error & DXL_ERROR_HEAT || all[DXL_HEAT] >= HOT_CELSIUS) return REASON_HOT;
    if (r->check_pass == 2 && get16(all + DXL_TORQUE_LIMIT) != torque_limit(r, j)) return REASON_GOAL_REFUSED;
    if (r->check_pass >= 1 && distance(get16(all + DXL_POSITION), s->position) > CHECK_SPREAD) return REASON_MOVED_BY_HAND;
    return REASON_NONE;
}

static void advance(struct robot *r) {
    r->tries = 0;
    r->noise = false;
    r->turn++;
    if (r->turn < r->joints) return;
    r->turn = 0;
    r->round_over = true;
}

static void check_over(struct robot *r) {
    uint32_t low = 0;
    for (uint32_t j = 0; j < r->joints; j++) low += r->servo[j].volts < LOW_DECIVOLT;
    if (2u * low > r->joints)
        enter(r, STATE_LIMP, REASON_LOW_BATTERY, 0xFF);
    else
        ramp_to_neutral(r, r->check_for, r->check_for == STATE_YIELD ? STATE_LIMP : STATE_NEUTRAL);
}

static void check_answer(struct robot *r, bool right, uint8_t trouble) {
    const uint8_t *all = r->bus.rx + 5;
    uint32_t j = r->turn;
    uint8_t against = right ? objection(r, j, all, r->bus.rx[4]) : trouble;
    if (!right && booting(r)) return; /* asked again until it has started */
    if (against) {
        r->tries++;
        r->send_limits = against == REASON_GOAL_REFUSED;
        if (r->tries >= CHECK_TRIES) enter(r, STATE_LIMP, against, table_id(playing(r), j));
        return;
    }
    keep(&r->servo[j], all + FIRST_READ, r->bus.rx[4], r->now);
    keep_settings(&r->servo[j], all);
    advance(r);
    if (r->turn) return;
    r->check_pass++;
    if (r->check_pass == 2) r->send_limits = true; /* the third time it is seen whether they have them */
    if (r->check_pass == 3) check_over(r);
}

static void bad(struct robot *r, uint32_t j, bool noise) {
    struct servo *s = &r->servo[j];
    r->failed_row++;
    r->send_blank = r->failed_row == FLUSH_ROW;
    if (noise) { /* two of one ID garble an answer, and the end of theirs the next question: nobody answers that */
        r->garbled_row++;
        r->noise = true;
    }
    if (r->failed_row > FAILED_ROW && r->failed_row > r->joints) {
        react(r, 2u * r->garbled_row > r->failed_row ? REASON_BABBLE : REASON_DEAD_SUPPLY, 0xFF);
        r->failed_row = r->garbled_row = 0;
    }
    if (++r->tries < TRIES) return;
    s->missed = (uint8_t)(s->missed + (s->missed < 255u));
    if (r->noise) s->garbled = (uint8_t)(s->garbled + (s->garbled < 255u));
    s->fresh = false;
    advance(r);
}

/* After a round: no pause before every goal is known to be there. */
static void look_again(struct robot *r) {
    for (uint32_t j = 0; j < r->joints; j++) {
        if (r->round_over && torque_on(r) && !r->servo[j].verified && r->servo[j].missed == 0) {
            r->round_over = false;
            r->sweep_started = r->now;
        }
    }
}

void read_answer(struct robot *r) {
    uint32_t j = r->turn;
    uint8_t count = (uint8_t)(r->bus.expected - DXL_OVERHEAD);
    enum dxl_answer a = dxl_status(r->bus.rx, r->bus.rx_length, table_id(playing(r), j), count);
    bool whole = count == DXL_END;
    if (whole != (r->state == STATE_CHECK)) return; /* the state has changed since it was asked */
    if (whole) {
        check_answer(r, a == DXL_OK, a == DXL_SILENT ? REASON_SILENT : REASON_GARBLED);
        return;
    }
    if (a != DXL_OK) {
        bad(r, j, a != DXL_SILENT);
    } else {
        r->failed_row = r->garbled_row = 0;
        advance(r);
        good(r, j, r->bus.rx + 5, r->bus.rx[4]);
    }
    if (r->round_over) {
        tell_log(r);
        judge_round(r);
        motion_round(r);
        look_again(r);
    }
}
