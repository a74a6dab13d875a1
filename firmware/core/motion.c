/* Poses in time, ramps, and torque off. */
#include "robot.h"

static void new_goals(struct robot *r) {
    r->send_goals = true;
    r->resends = 0;
}

void release(struct robot *r) {
    r->send_goals = r->send_limits = false;
    r->send_release = true;
    r->off_twice = false;
    for (uint32_t j = 0; j < r->joints; j++) r->servo[j].off = false;
}

/* The joint's torque limit: its own, or less on the first way to neutral. */
uint16_t torque_limit(const struct robot *r, uint32_t joint) {
    uint16_t own = r->servo[joint].torque_limit;
    return r->gentle && own > RAMP_TORQUE ? RAMP_TORQUE : own;
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
    r->stop_asked = r->ending = false;
    r->next_pose = r->now + POSE_GUARD_MS; /* on the tick, as all that follow: what is under way on the bus is over by then */
}

/* The moving speed that brings a joint from one goal to another in the dwell of that pose [counts of the register]. */
static uint32_t speed_of_way(uint32_t way, uint32_t dwell_ms) {
    uint32_t a_second = dwell_ms < 4000u ? (way * 1000u + dwell_ms - 1u) / dwell_ms : (way + 3u) / 4u;
    return (a_second * 1000u + SPEED_MILLI - 1u) / SPEED_MILLI;
}

/* Replaces a table's speed 0 ("at once"), at which a servo would move as fast as it can. The way from the last goal takes the pose's
   dwell; without such a way the servo keeps its speed, as it may still be moving. */
static uint16_t speed_to_send(const struct robot *r, uint32_t pose, uint32_t j, uint16_t from) {
    const uint8_t *t = playing(r);
    uint32_t speed = table_speed(t, pose, j), way = distance(table_goal(t, pose, j), from);
    if (speed) return (uint16_t)speed;
    speed = way ? speed_of_way(way, table_dwell(t, pose)) : r->speeds[j];
    if (way && speed < RAMP_SLOWEST) speed = RAMP_SLOWEST;
    return (uint16_t)(speed < table_fastest(t, j) ? speed : table_fastest(t, j));
}

/* Whether the first pose can be sent from neutral: none of the joints that the table sends there at once would have to go faster
   than a ramp. The computer's player and the simulation go by the same rule. */
static bool startable(const struct robot *r) {
    const uint8_t *t = playing(r);
    for (uint32_t j = 0; j < r->joints; j++) {
        uint32_t way = distance(table_goal(t, 0, j), r->goals[j]);
        if (table_speed(t, 0, j) == 0 && speed_of_way(way, table_dwell(t, 0)) > RAMP_SPEED) return false;
    }
    return true;
}

static void ramp_to_pose(struct robot *r, uint32_t pose) {
    uint16_t goals[MAX_JOINTS];
    for (uint32_t j = 0; j < r->joints; j++) goals[j] = table_goal(playing(r), pose, j);
    ramp_to(r, goals, STATE_RAMP, STATE_PLAY);
}

void play_from_neutral(struct robot *r, uint8_t reason) {
    enter(r, STATE_PLAY, reason, 0xFF);
    begin_play(r);
    if (!startable(r)) ramp_to_pose(r, 0);
}

/* Another table takes over in the walk: at its loop if that is near enough, else (where the PC allows it) from its beginning, after a
   ramp to where that begins. True where its next pose is to be sent now. */
static bool take_over(struct robot *r, bool reachable) {
    upload_take(&r->upload);
    r->cycle = 0;
    r->table_fault = TABLE_OK;
    r->pose = table_start(playing(r));
    if (reachable) return true;
    if (table_start(playing(r)))
        ramp_to_neutral(r, STATE_RAMP, STATE_PLAY);
    else
        ramp_to_pose(r, table_loop_end(playing(r)) - 1u);
    return false;
}

static void wind_up(struct robot *r) {
    if (!r->stop_asked) r->reason = REASON_ENDED;
    r->ending = true;
    r->pose = table_loop_end(playing(r));
}

/* Where a cycle has ended: another table, another cycle, the stop, or neutral. True where the next pose is to be sent now. */
static bool turn_over(struct robot *r) {
    r->cycle++;
    if (upload_ready(&r->upload) && !r->stop_asked) {
        bool reachable = table_reachable(r->upload.spare, r->goals);
        if (reachable || (r->upload.flags & UPLOAD_RAMPS)) return take_over(r, reachable);
        upload_drop(&r->upload);
        r->table_fault = TABLE_UNREACHABLE;
        r->state_told = false;
    }
    r->pose = table_start(playing(r));
    if ((table_flags(playing(r)) & TABLE_STOPS) && r->cycle >= table_cycles(playing(r))) wind_up(r);
    return true;
}

/* Whether r->pose is the next pose to send; where all have been, the way to neutral begins. */
static bool pose_follows(struct robot *r) {
    const uint8_t *t = playing(r);
    if (!r->ending && r->pose == table_loop_end(t) && !turn_over(r)) return false;
    if (!r->ending && r->stop_asked && r->pose == table_start(playing(r))) wind_up(r);
    if (r->pose < table_poses(playing(r))) return true;
    ramp_to_neutral(r, STATE_STOP, STATE_NEUTRAL);
    return false;
}

static void pose_due(struct robot *r) {
    if (!pose_follows(r)) return;
    for (uint32_t j = 0; j < r->joints; j++) {
        r->speeds[j] = speed_to_send(r, r->pose, j, r->goals[j]);
        r->goals[j] = table_goal(playing(r), r->pose, j);
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
        r->off_twice = !r->off_twice;
        r->send_release = r->off_twice; /* asked for again as long as some servo is not known to be off */
        bus_ask(&r->bus, dxl_write(r->bus.tx, DXL_BROADCAST, DXL_TORQUE, &off, 1), 0, BUS_TIMEOUT_MS, r->now);
        return true;
    }
    if (r->send_limits) {
        uint16_t limits[MAX_JOINTS];
        r->send_limits = false;
        for (uint32_t j = 0; j < r->joints; j++) limits[j] = torque_limit(r, j);
        bus_ask(&r->bus, dxl_sync_limits(r->bus.tx, playing(r), limits), 0, BUS_TIMEOUT_MS, r->now);
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
