/* libFuzzer: any bytes as a table, with and without the sum made right; what is accepted can be read to its last pose. */
#include <stdlib.h>

#include "../core/crc.h"
#include "../core/table.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size > 60000u) return 0;
    uint8_t *t = malloc(size ? size : 1);
    memcpy(t, data, size);
    if (size > TABLE_HEAD + 4u && (data[size - 1u] & 1u)) {
        put32(t + 12, (uint32_t)size);
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
