#include "table.h"

#include "crc.h"

static enum table_fault check_joint(const uint8_t *t, uint32_t j) {
    if (table_id(t, j) > 253u || table_joint(t, j)[1] != 0) return TABLE_BUS_ID;
    for (uint32_t k = 0; k < j; k++)
        if (table_id(t, k) == table_id(t, j)) return TABLE_BUS_ID;
    if (table_low(t, j) > table_neutral(t, j) || table_neutral(t, j) > table_high(t, j)) return TABLE_BOUNDS;
    if (table_high(t, j) > GOAL_LIMIT || table_fastest(t, j) == 0 || table_fastest(t, j) > SPEED_LIMIT) return TABLE_BOUNDS;
    return TABLE_OK;
}

static enum table_fault check_counts(const uint8_t *t) {
    if (table_joints(t) == 0 || table_joints(t) > MAX_JOINTS) return TABLE_JOINTS;
    if (table_start(t) + table_stop(t) >= table_poses(t)) return TABLE_POSES;
    if (table_flags(t) & ~TABLE_STOPS) return TABLE_FLAGS;
    if ((table_flags(t) & TABLE_STOPS) && table_cycles(t) == 0) return TABLE_FLAGS;
    return TABLE_OK;
}

enum table_fault table_check_head(const uint8_t *t, uint32_t size) {
    if (size < TABLE_HEAD) return TABLE_SHORT;
    if (get32(t) != TABLE_MAGIC_WORD) return TABLE_MAGIC;
    if (t[4] != 1u && t[4] != 2u) return TABLE_VERSION;
    if (size < table_head(t)) return TABLE_SHORT;
    enum table_fault counts = check_counts(t);
    if (counts) return counts;
    uint32_t n = table_joints(t), poses = table_poses(t);
    if (table_size(t) != size || size != table_head(t) + TABLE_JOINT * n + (4u + 4u * n) * poses + 4u) return TABLE_SIZE;
    for (uint32_t j = 0; j < n; j++) {
        enum table_fault fault = check_joint(t, j);
        if (fault) return fault;
    }
    return TABLE_OK;
}

enum table_fault table_check_pose(const uint8_t *t, uint32_t p) {
    if (table_dwell(t, p) < SHORTEST_MS || table_dwell(t, p) > LONGEST_MS) return TABLE_DWELL;
    for (uint32_t j = 0; j < table_joints(t); j++) {
        if (table_goal(t, p, j) < table_low(t, j) || table_goal(t, p, j) > table_high(t, j)) return TABLE_GOAL;
        if (table_speed(t, p, j) > table_fastest(t, j)) return TABLE_SPEED;
    }
    return TABLE_OK;
}

enum table_fault table_check(const uint8_t *t, uint32_t size) {
    enum table_fault fault = table_check_head(t, size);
    if (fault) return fault;
    if (crc32(0, t, size - 4u) != get32(t + size - 4u)) return TABLE_CRC;
    for (uint32_t p = 0; p < table_poses(t) && !fault; p++) fault = table_check_pose(t, p);
    return fault;
}

enum table_fault table_fits(const uint8_t *t, const uint8_t *of) {
    if (table_joints(t) != table_joints(of)) return TABLE_OTHER_ROBOT;
    for (uint32_t j = 0; j < table_joints(t); j++) {
        if (table_id(t, j) != table_id(of, j) || table_model(t, j) != table_model(of, j)) return TABLE_OTHER_ROBOT;
        if (table_low(t, j) < table_low(of, j) || table_high(t, j) > table_high(of, j)) return TABLE_BOUNDS;
        if (table_fastest(t, j) > table_fastest(of, j) || table_neutral(t, j) != table_neutral(of, j)) return TABLE_BOUNDS;
    }
    return TABLE_OK;
}

bool table_reachable(const uint8_t *next, const uint16_t *from) {
    uint32_t first = table_start(next), dwell = table_dwell(next, first);
    if (dwell > 4000u) dwell = 4000u; /* time enough for any way */
    for (uint32_t j = 0; j < table_joints(next); j++) {
        uint32_t speed = table_speed(next, first, j);
        if (speed == 0 || speed > FASTEST_SPEED) speed = FASTEST_SPEED;
        uint32_t reach = speed * SPEED_MILLI / 1000u * dwell / 1000u;
        if (distance(from[j], table_goal(next, first, j)) > reach + reach / 10u + 8u) return false; /* a tenth and 2 degrees late: let it */
    }
    return true;
}
