#include "dynamixel.h"

#include "table.h"

uint8_t dxl_sum(const uint8_t *packet, uint32_t n) {
    uint32_t sum = 0;
    for (uint32_t k = 2; k < n - 1u; k++) sum += packet[k];
    return (uint8_t)~sum;
}

static uint32_t finish(uint8_t *out, uint8_t id, uint8_t instruction, uint32_t parameters) {
    out[0] = out[1] = 0xFF;
    out[2] = id;
    out[3] = (uint8_t)(parameters + 2u);
    out[4] = instruction;
    out[5 + parameters] = dxl_sum(out, parameters + DXL_OVERHEAD);
    return parameters + DXL_OVERHEAD;
}

uint32_t dxl_blank(uint8_t *out, uint32_t count) {
    for (uint32_t k = 0; k < count; k++) out[k] = 0;
    return count;
}

uint32_t dxl_read(uint8_t *out, uint8_t id, uint8_t address, uint8_t count) {
    out[5] = address;
    out[6] = count;
    return finish(out, id, DXL_READ, 2);
}

uint32_t dxl_write(uint8_t *out, uint8_t id, uint8_t address, const uint8_t *values, uint32_t count) {
    out[5] = address;
    for (uint32_t k = 0; k < count; k++) out[6 + k] = values[k];
    return finish(out, id, DXL_WRITE, count + 1u);
}

uint32_t dxl_sync_limits(uint8_t *out, const uint8_t *table, const uint16_t *limits) {
    uint8_t *at = out + 7;
    out[5] = DXL_TORQUE_LIMIT;
    out[6] = 2;
    for (uint32_t j = 0; j < table_joints(table); j++, at += 3) {
        at[0] = table_id(table, j);
        put16(at + 1, limits[j]);
    }
    return finish(out, DXL_BROADCAST, DXL_SYNC_WRITE, 2u + 3u * table_joints(table));
}

uint32_t dxl_sync_goals(uint8_t *out, const uint8_t *table, const uint16_t *goals, const uint16_t *speeds) {
    uint8_t *at = out + 7;
    out[5] = DXL_GOAL;
    out[6] = 4;
    for (uint32_t j = 0; j < table_joints(table); j++, at += 5) {
        at[0] = table_id(table, j);
        put16(at + 1, goals[j]);
        put16(at + 3, speeds[j]);
    }
    return finish(out, DXL_BROADCAST, DXL_SYNC_WRITE, 2u + 5u * table_joints(table));
}

enum dxl_answer dxl_status(const uint8_t *in, uint32_t n, uint8_t id, uint32_t count) {
    if (n == 0) return DXL_SILENT;
    if (n < count + DXL_OVERHEAD) return DXL_CUT;
    if (n > count + DXL_OVERHEAD || in[0] != 0xFF || in[1] != 0xFF || in[3] != count + 2u) return DXL_GARBLED;
    if (dxl_sum(in, n) != in[n - 1u]) return DXL_GARBLED;
    return in[2] == id ? DXL_OK : DXL_FOREIGN;
}
