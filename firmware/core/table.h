/* The binary table that is played. docs/robot.md defines its layout; it is checked before it is used. */
#ifndef TABLE_H
#define TABLE_H

#include "bytes.h"
#include "limits.h"

#define TABLE_MAGIC_WORD 0x42544257u /* "WBTB" */
#define TABLE_HEAD 16u
#define TABLE_SECTIONS_HEAD 20u /* of version 2, with the sections' sizes */
#define TABLE_JOINT 12u
#define TABLE_STOPS 1u /* flag: stops after its cycles unless another table has come; without it, repeats */

enum table_fault {
    TABLE_OK, TABLE_SHORT, TABLE_MAGIC, TABLE_VERSION, TABLE_JOINTS, TABLE_POSES, TABLE_FLAGS, TABLE_SIZE, TABLE_BUS_ID,
    TABLE_BOUNDS, TABLE_DWELL, TABLE_GOAL, TABLE_SPEED, TABLE_CRC, TABLE_OTHER_ROBOT, TABLE_UNREACHABLE
};

/* Head and joints, `size` bytes being there in all; to be called before any accessor. */
enum table_fault table_check_head(const uint8_t *t, uint32_t size);

/* One pose of a table whose head is right. */
enum table_fault table_check_pose(const uint8_t *t, uint32_t pose);

/* All of it, with the CRC. */
enum table_fault table_check(const uint8_t *t, uint32_t size);

/* Whether `t` is for the robot of `of`: the same joints in the same order, bounds no wider. */
enum table_fault table_fits(const uint8_t *t, const uint8_t *of);

/* Whether the loop's first pose of `next` can be reached from the goals at `from` (MAX_JOINTS of them) in its own dwell. */
bool table_reachable(const uint8_t *next, const uint16_t *from);

static inline uint32_t table_joints(const uint8_t *t) { return t[5]; }
static inline uint32_t table_poses(const uint8_t *t) { return get16(t + 6); }
static inline uint32_t table_flags(const uint8_t *t) { return get16(t + 8); }
static inline uint32_t table_cycles(const uint8_t *t) { return get16(t + 10); }
static inline uint32_t table_size(const uint8_t *t) { return get32(t + 12); }
static inline uint32_t table_head(const uint8_t *t) { return t[4] == 1u ? TABLE_HEAD : TABLE_SECTIONS_HEAD; }
/* Poses of the start, played once; of the stop, played once at the end; what lies between is the loop. */
static inline uint32_t table_start(const uint8_t *t) { return t[4] == 1u ? 0u : get16(t + 16); }
static inline uint32_t table_stop(const uint8_t *t) { return t[4] == 1u ? 0u : get16(t + 18); }
static inline uint32_t table_loop_end(const uint8_t *t) { return table_poses(t) - table_stop(t); }
static inline const uint8_t *table_joint(const uint8_t *t, uint32_t j) { return t + table_head(t) + TABLE_JOINT * j; }
static inline uint8_t table_id(const uint8_t *t, uint32_t j) { return table_joint(t, j)[0]; }
static inline uint16_t table_model(const uint8_t *t, uint32_t j) { return get16(table_joint(t, j) + 2); }
static inline uint16_t table_low(const uint8_t *t, uint32_t j) { return get16(table_joint(t, j) + 4); }
static inline uint16_t table_high(const uint8_t *t, uint32_t j) { return get16(table_joint(t, j) + 6); }
static inline uint16_t table_fastest(const uint8_t *t, uint32_t j) { return get16(table_joint(t, j) + 8); }
static inline uint16_t table_neutral(const uint8_t *t, uint32_t j) { return get16(table_joint(t, j) + 10); }
static inline const uint8_t *table_pose(const uint8_t *t, uint32_t p) {
    uint32_t n = table_joints(t);
    return t + table_head(t) + TABLE_JOINT * n + (4u + 4u * n) * p;
}
static inline uint32_t table_dwell(const uint8_t *t, uint32_t p) { return get32(table_pose(t, p)); }
static inline uint16_t table_goal(const uint8_t *t, uint32_t p, uint32_t j) { return get16(table_pose(t, p) + 4u + 4u * j); }
static inline uint16_t table_speed(const uint8_t *t, uint32_t p, uint32_t j) { return get16(table_pose(t, p) + 6u + 4u * j); }

#endif
