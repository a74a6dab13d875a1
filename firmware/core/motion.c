/* Poses in time, ramps, and torque off. */
#include "robot.h"

static void new_goals(struct robot *r) {
    r->send_goals = true;
    r->resends = 0;
}

void release(struct robot *r) {
    r->send_goals = false;
    r->send_release = true;
    for (uint32_t j = 0; j < r->joints; j++) r->servo[j].off = false;
}

/* All joints arrive together, the one with the longest way at the ramp's speed. */
void ramp_to(struct robot *r, const uint16_t *goals, uint8_t state, uint8_t after) {
    uint32_t longest = 1;
    for (uint32_t j = 0; j < r->joints; j++) {
        uint32_t way = distance(goals[j], r->servo[j].position);
        if (way > longest) longest = way;
    }
    for (uint32_t j = 0; j < r->joints; j++) {
        uint32_t way = distance(goals[j], r->servo[j].position);
        r->goals[j] = goals[j];
        uint32_t speed = way * RAMP_SPEED / longest;
        r->speeds[j] = (uint16_t)(speed > RAMP_SLOWEST ? speed : RAMP_SLOWEST);
    }
    r->state = state;
    r->after = after;
    r->seating = SEAT_NOT;
    r->state_told = false;
    r->ramp_ends = r->now + longest * 1000u * 1000u / (RAMP_SPEED * SPEED_MILLI);
    new_goals(r);
}

void ramp_to_neutral(struct robot *r, uint8_t state, uint8_t after) {
    uint16_t neutral[MAX_JOINTS];
    for (uint32_t j = 0; j < r->joints; j++) neutral[j] = table_neutral(playing(r), j);
    ramp_to(r, neutral, state, after);
}

void begin_play(struct robot *r) {
    if (upload_ready(&r->upload)) upload_take(&r->upload);
    r->pose = r->cycle = 0;
    r->next_pose = r->now + POSE_GUARD_MS; /* on the tick, as all that follow: what is under way on the bus is over by then */
}

static void ramp_to_table(struct robot *r) {
    uint16_t last[MAX_JOINTS];
    uint32_t end = table_poses(playing(r)) - 1u;
    for (uint32_t j = 0; j < r->joints; j++) last[j] = table_goal(playing(r), end, j);
    ramp_to(r, last, STATE_RAMP, STATE_PLAY);
}

/* Where a cycle has ended: another table, another cycle, or neutral. True where the next pose is to be sent now. */
static bool turn_over(struct robot *r) {
    r->pose = 0;
    r->cycle++;
    if (upload_ready(&r->upload)) {
        bool reachable = table_reachable(r->upload.spare, r->goals);
        if (reachable || (r->upload.flags & UPLOAD_RAMPS)) {
            upload_take(&r->upload);
            r->cycle = 0;
            r->table_fault = TABLE_OK;
            if (!reachable) ramp_to_table(r);
            return reachable;
        }
        upload_drop(&r->upload);
        r->table_fault = TABLE_UNREACHABLE;
        r->state_told = false;
    }
    if ((table_flags(playing(r)) & TABLE_STOPS) && r->cycle >= table_cycles(playing(r))) {
        r->reason = REASON_ENDED;
        ramp_to_neutral(r, STATE_STOP, STATE_NEUTRAL);
        return false;
    }
    return true;
}

static void pose_due(struct robot *r) {
    if (r->pose >= table_poses(playing(r)) && !turn_over(r)) return;
    for (uint32_t j = 0; j < r->joints; j++) {
        r->goals[j] = table_goal(playing(r), r->pose, j);
        r->speeds[j] = table_speed(playing(r), r->pose, j);
    }
    r->next_pose += table_dwell(playing(r), r->pose);
    r->pose++;
    new_goals(r);
}

/* Whether a transaction that takes so long [ms] would be in the way of the next pose. */
bool reserved(const struct robot *r, uint32_t ms) { return r->state == STATE_PLAY && r->next_pose - r->now < ms; }

/* Sends goals or torque-off if that is due; true where the bus is taken, or has to stay free for the next pose. */
bool motion_send(struct robot *r) {
    if (r->send_release) {
        static const uint8_t off = 0;
        r->send_release = false; /* asked for again by whoever reads that a servo is still on */
        bus_ask(&r->bus, dxl_write(r->bus.tx, DXL_BROADCAST, DXL_TORQUE, &off, 1), 0, BUS_TIMEOUT_MS, r->now);
        return true;
    }
    bool due = r->state == STATE_PLAY && (int32_t)(r->now - r->next_pose) >= 0;
    if (due) pose_due(r);
    if (r->send_goals && (due || !reserved(r, 2))) {
        r->send_goals = false;
        for (uint32_t j = 0; j < r->joints; j++) r->servo[j].verified = false;
        bus_ask(&r->bus, dxl_sync_goals(r->bus.tx, playing(r), r->goals, r->speeds), 0, BUS_TIMEOUT_MS, r->now);
        return true;
    }
    return reserved(r, POSE_GUARD_MS);
}

static bool arrived(const struct robot *r) {
    for (uint32_t j = 0; j < r->joints; j++) {
        const struct servo *s = &r->servo[j];
        if (s->missed == 0 && (!s->verified || distance(s->position, r->goals[j]) > RAMP_TOLERANCE)) return false;
    }
    return true;
}

/* Before it holds neutral each joint is brought there itself, by as much beyond as it hangs below; then all are told neutral. So they
   rest where they fall to from there, whatever they came from: friction would hold them elsewhere. False once that is over. */
static bool seat(struct robot *r) {
    bool moved = false;
    if (r->seating == SEAT_DONE) return false;
    for (uint32_t j = 0; j < r->joints; j++) {
        int32_t neutral = table_neutral(playing(r), j), goal = neutral, by = neutral - (int32_t)r->servo[j].position;
        if (r->seating == SEAT_NOT) goal += by > SEAT_COUNTS ? SEAT_COUNTS : by < -SEAT_COUNTS ? -SEAT_COUNTS : by;
        if (goal < table_low(playing(r), j)) goal = table_low(playing(r), j);
        if (goal > table_high(playing(r), j)) goal = table_high(playing(r), j);
        moved = moved || goal != (int32_t)r->goals[j];
        r->goals[j] = (uint16_t)goal;
        r->speeds[j] = RAMP_SPEED;
    }
    r->seating++;
    if (!moved) return false;
    r->ramp_ends = r->now + SEAT_MS;
    new_goals(r);
    return true;
}

/* After every round of readings: has a ramp come to its end? */
void motion_round(struct robot *r) {
    if (r->state != STATE_RAMP && r->state != STATE_STOP && r->state != STATE_YIELD) return;
    int32_t late = (int32_t)(r->now - r->ramp_ends);
    if (late < 0) return;
    if (arrived(r)) {
        if (r->after == STATE_NEUTRAL && seat(r)) return;
        if (r->after == STATE_PLAY) begin_play(r);
        enter(r, r->after, r->reason, r->servo_named);
    } else if (late > (int32_t)RAMP_SPARE_MS) {
        bool told = r->state == STATE_YIELD; /* the first reason stands */
        enter(r, STATE_LIMP, told ? r->reason : REASON_NOT_ARRIVED, told ? r->servo_named : 0xFF);
    }
}
