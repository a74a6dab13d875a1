#include "monitor.h"

#define AFTER_STOP 50u      /* ms until a stop or release has to be obeyed */
#define FOUND 400u          /* ms until a servo's fault has to be noticed */
#define LET_GO 12000u       /* ms until torque has to be off then: a ramp turns 150 deg in 5 s, and is given 2 s more */
#define STARTING 2400u      /* ms after a reset in which servos that start are waited for */
#define NEVER 0xFFFFFFFFu

void monitor_begin(struct monitor *m, uint32_t joints, bool power_on) {
    m->joints = joints;
    m->rule = RULE_NONE;
    m->allowed = power_on;
    m->released = m->any_before = false;
    m->release_at = m->stop_at = m->deaf_since = m->go_at = NEVER;
    m->reset_at = 0;
    for (uint32_t j = 0; j < joints; j++) {
        m->before[j] = false;
        m->yields[j] = true;
        m->hears_since[j] = NEVER;
        m->goal_before[j] = 0;
        m->bad_since[j] = NEVER;
    }
}

static void broken(struct monitor *m, uint32_t rule, uint32_t ms, uint32_t joint) {
    if (m->rule) return;
    m->rule = rule;
    m->rule_at = ms;
    m->rule_joint = joint;
}

static uint32_t away(const struct monitor_joint *j, uint16_t goal) {
    return goal > j->neutral ? (uint32_t)(goal - j->neutral) : (uint32_t)(j->neutral - goal);
}

/* Whether a new goal only brings the joint back: neutral, or a step towards it, at no more than a ramp's speed. */
static bool back(const struct monitor_joint *j, uint16_t before) {
    uint32_t far = away(j, before);
    return away(j, j->goal) <= (far > j->near ? far : j->near) && j->speed >= 1u && j->speed <= j->ramp;
}

static bool due(uint32_t since, uint32_t ms, uint32_t after) { return since != NEVER && ms - since > after; }

static void ask(struct monitor *m, uint32_t ms, uint32_t asked) {
    if (asked & ASKED_GO) {
        m->allowed = true;
        m->go_at = ms;
        m->stop_at = m->release_at = NEVER;
    }
    if ((asked & ASKED_STOP) && m->stop_at == NEVER) m->stop_at = ms;
    if (asked & ASKED_RELEASE) {
        m->allowed = false;
        m->released = true;
        if (m->release_at == NEVER) m->release_at = ms;
    }
    if (asked & ASKED_RESET) m->reset_at = ms;
}

static void look_at(struct monitor *m, uint32_t ms, uint32_t k) {
    const struct monitor_joint *j = &m->joint[k];
    bool rose = j->torque && !m->before[k];
    bool other_goal = j->goal != m->goal_before[k];
    if (other_goal || away(j, j->goal) <= j->near) m->yields[k] = back(j, m->goal_before[k]);
    m->before[k] = j->torque;
    m->goal_before[k] = j->goal;
    if (!j->hears) m->hears_since[k] = NEVER;
    else if (m->hears_since[k] == NEVER) m->hears_since[k] = ms;
    if (rose && !m->allowed) broken(m, RULE_TORQUE_RETURNED, ms, k);
    if (!j->torque) return;
    if (rose && !m->any_before && !m->raw && (j->limit > j->half || j->speed > j->ramp)) broken(m, RULE_FIRST_TORQUE, ms, k);
    if (j->goal < j->low || j->goal > j->high) broken(m, RULE_BOUNDS, ms, k);
    if (j->speed == 0 || (j->speed > j->fastest && j->speed > j->ramp)) broken(m, RULE_SPEED, ms, k);
    if (!j->hears || m->deaf) return;
    if (due(m->release_at, ms, AFTER_STOP) && ms - m->hears_since[k] > AFTER_STOP) broken(m, RULE_HELD_ON, ms, k);
    if (due(m->stop_at, ms, AFTER_STOP) && other_goal && !m->yields[k]) broken(m, RULE_MOVED_AFTER_STOP, ms, k);
}

/* Something has been wrong with a joint for long, while others move on, or hold on for ever. */
static void look_for_what_is_wrong(struct monitor *m, uint32_t ms, bool any) {
    bool moving = false;
    for (uint32_t k = 0; k < m->joints; k++) {
        const struct monitor_joint *j = &m->joint[k];
        moving = moving || (j->torque && !m->yields[k] && j->hears && ms - m->hears_since[k] > AFTER_STOP);
    }
    for (uint32_t k = 0; k < m->joints; k++) {
        const struct monitor_joint *j = &m->joint[k];
        bool bad = !j->answers || j->hot || j->overloaded;
        if (!bad || !any) m->bad_since[k] = NEVER;
        else if (m->bad_since[k] == NEVER) m->bad_since[k] = ms;
        if (m->deaf) continue;
        uint32_t since = m->bad_since[k], started = m->reset_at + STARTING;
        if (!j->answers && since != NEVER && since < started) since = started; /* it may still be starting */
        if (since != NEVER && since > ms) continue;
        if ((moving && due(since, ms, FOUND)) || due(since, ms, LET_GO)) broken(m, RULE_NOT_FOUND, ms, k);
    }
}

void monitor_look(struct monitor *m, uint32_t ms, uint32_t asked) {
    bool any = false;
    ask(m, ms, asked);
    if (m->deaf) { /* what is asked meanwhile is obeyed once it is quiet */
        if (m->release_at != NEVER) m->release_at = ms;
        if (m->stop_at != NEVER) m->stop_at = ms;
    }
    for (uint32_t k = 0; k < m->joints; k++) look_at(m, ms, k);
    for (uint32_t k = 0; k < m->joints; k++) any = any || m->joint[k].torque;
    if (m->any_before && !any && (m->go_at == NEVER || ms - m->go_at > AFTER_STOP)) m->allowed = false; /* let go, by whomever */
    m->any_before = any;
    look_for_what_is_wrong(m, ms, any);
}
