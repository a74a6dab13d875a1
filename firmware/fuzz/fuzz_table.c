/* libFuzzer: any bytes as a table, with and without the sum made right; an accepted table can be read to its last pose. */
#include <stdlib.h>

#include "../core/crc.h"
#include "../core/table.h"

/* Makes a table of any bytes: as many joints and poses as they hold, valid except where the number of joints is not. */
static size_t mend(uint8_t *t, size_t size) {
    uint32_t n = t[5];
    size_t fixed = TABLE_HEAD + TABLE_JOINT * n + 4u, each = 4u + 4u * n;
    if (n == 0 || size < fixed + each) return size;
    uint32_t poses = (uint32_t)((size - fixed) / each);
    size = fixed + each * poses;
    put32(t, TABLE_MAGIC_WORD);
    t[4] = 1;
    put16(t + 6, poses);
    put32(t + 8, 0);
    for (uint32_t j = 0; j < n; j++) {
        static const uint8_t sound[TABLE_JOINT] = {0, 0, 12, 0, 0, 0, 0xFF, 3, 0xFF, 3, 0, 2};
        memcpy(t + TABLE_HEAD + TABLE_JOINT * j, sound, TABLE_JOINT);
        t[TABLE_HEAD + TABLE_JOINT * j] = (uint8_t)j;
    }
    for (uint8_t *p = t + TABLE_HEAD + TABLE_JOINT * n; p < t + size - 4u; p += each) {
        put32(p, 10u + p[0]);
        for (uint32_t k = 5; k < each; k += 2) p[k] &= 3u;
    }
    return size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size > 60000u) return 0;
    uint8_t *t = malloc(size ? size : 1);
    memcpy(t, data, size);
    uint8_t how = size > TABLE_HEAD + 4u ? data[size - 1u] : 0;
    if ((how & 6u) == 6u) size = mend(t, size);
    if (how & 1u) {
        put32(t + 12, (uint32_t)size);
        if ((how & 8u) && size > 40u) t[size - 8u] ^= 0x80u; /* a last goal or speed out of bounds */
        put32(t + size - 4u, crc32(0, t, (uint32_t)size - 4u));
    }
    if (table_check(t, (uint32_t)size) == TABLE_OK) {
        uint16_t goals[MAX_JOINTS];
        uint32_t last = table_poses(t) - 1u;
        for (uint32_t j = 0; j < table_joints(t); j++) {
            goals[j] = table_goal(t, last, j);
            if (goals[j] < table_low(t, j) || goals[j] > table_high(t, j) || table_speed(t, last, j) > table_fastest(t, j)) abort();
        }
        if (table_fits(t, t) != TABLE_OK) abort();
        (void)table_reachable(t, goals);
    }
    free(t);
    return 0;
}
