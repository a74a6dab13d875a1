/* For callers that know no struct: Python by ctypes. */
#include "sim.h"

#include <stdlib.h>
#include <string.h>

struct sim *sim_new(void) { return calloc(1, sizeof(struct sim)); }
void sim_free(struct sim *s) { free(s); }

static uint32_t *number(struct sim *s, const char *what) {
    const struct { const char *name; uint32_t *at; } fields[] = {
        {"poses", &s->poses}, {"goal_errors", &s->goal_errors}, {"wrong_longest", &s->wrong_longest}, {"events", &s->events},
        {"flip_to", &s->flip_to}, {"flip_from", &s->flip_from}, {"cycle", &s->r.cycle}, {"pose", &s->r.pose},
        {"stray", (uint32_t *)&s->r.bus.stray}};
    for (size_t k = 0; k < sizeof fields / sizeof *fields; k++)
        if (!strcmp(what, fields[k].name)) return fields[k].at;
    return NULL;
}

static uint8_t *byte_of(struct sim *s, const char *what, uint32_t k) {
    const struct { const char *name; uint8_t *at; } fields[] = {
        {"state", &s->r.state}, {"reason", &s->r.reason}, {"servo_named", &s->r.servo_named}, {"table_fault", &s->r.table_fault},
        {"volts", &s->volts}, {"heat", &s->servo[k].heat}, {"drop", &s->servo[k].drop}, {"hangs", &s->servo[k].hangs}, {"lead", &s->servo[k].lead}, {"lacks", &s->servo[k].lacks}, {"glitch", &s->glitch}, {"torque", &s->servo[k].table[DXL_TORQUE]},
        {"slope", &s->servo[k].table[28]}, {"model", &s->servo[k].table[DXL_MODEL]}, {"id", &s->servo[k].table[DXL_ID]},
        {"upload_state", &s->r.upload.state}};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++)
        if (!strcmp(what, fields[i].name)) return fields[i].at;
    return NULL;
}

static bool *flag(struct sim *s, const char *what, uint32_t k) {
    const struct { const char *name; bool *at; } fields[] = {
        {"mute", &s->servo[k].mute}, {"twin", &s->servo[k].twin}, {"overload", &s->servo[k].overload}, {"babble", &s->babble},
        {"start", &s->r.start_pressed}, {"powered", &s->servo[k].powered}, {"held", &s->servo[k].held}};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++)
        if (!strcmp(what, fields[i].name)) return fields[i].at;
    return NULL;
}

uint64_t sim_get(struct sim *s, const char *what, uint32_t k) {
    if (!strcmp(what, "goal")) return get16(s->servo[k].table + DXL_GOAL);
    if (!strcmp(what, "torque_limit")) return get16(s->servo[k].table + DXL_TORQUE_LIMIT);
    if (!strcmp(what, "speed")) return get16(s->servo[k].table + DXL_SPEED);
    if (!strcmp(what, "position")) return (uint64_t)(s->servo[k].milli / 1000);
    if (!strcmp(what, "event_us")) return s->log[k].us;
    if (!strcmp(what, "event_kind")) return s->log[k].kind;
    if (!strcmp(what, "event_state")) return s->log[k].state;
    if (!strcmp(what, "event_pose")) return s->log[k].pose;
    if (!strcmp(what, "event_resends")) return s->log[k].resends;
    if (!strcmp(what, "us")) return s->us;
    if (!strcmp(what, "sent")) return s->r.bus.tx[k];
    if (number(s, what)) return *number(s, what);
    if (byte_of(s, what, k)) return *byte_of(s, what, k);
    return flag(s, what, k) ? *flag(s, what, k) : UINT64_MAX;
}

void sim_set(struct sim *s, const char *what, uint32_t k, uint32_t value) {
    if (!strcmp(what, "position")) s->servo[k].milli = 1000 * (int64_t)value;
    if (!strcmp(what, "torque_limit")) put16(s->servo[k].table + DXL_TORQUE_LIMIT, value);
    if (!strcmp(what, "boots_until")) s->servo[k].boots_until = value;
    if (!strcmp(what, "turning")) put16(s->servo[k].table + DXL_PRESENT_SPEED, value);
    if (!strcmp(what, "load")) put16(s->servo[k].table + DXL_LOAD, value);
    if (!strcmp(what, "cw_limit")) put16(s->servo[k].table + DXL_CW_LIMIT, value);
    if (!strcmp(what, "ccw_limit")) put16(s->servo[k].table + DXL_CCW_LIMIT, value);
    if (number(s, what)) *number(s, what) = value;
    if (byte_of(s, what, k)) *byte_of(s, what, k) = (uint8_t)value;
    if (flag(s, what, k)) *flag(s, what, k) = value != 0;
}
