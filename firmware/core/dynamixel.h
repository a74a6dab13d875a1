/* Dynamixel Protocol 1.0: packets to servos, and what came back. */
#ifndef DYNAMIXEL_H
#define DYNAMIXEL_H

#include "bytes.h"

#define DXL_BROADCAST 0xFEu
#define DXL_OVERHEAD 6u /* bytes of a packet beside its parameters */

enum { DXL_PING = 1, DXL_READ = 2, DXL_WRITE = 3, DXL_REG_WRITE = 4, DXL_ACTION = 5, DXL_RESET = 6, DXL_SYNC_WRITE = 0x83 };
enum { DXL_ERROR_VOLTAGE = 1, DXL_ERROR_HEAT = 4, DXL_ERROR_OVERLOAD = 32 };
enum { DXL_MODEL = 0, DXL_ID = 3, DXL_CW_LIMIT = 6, DXL_CCW_LIMIT = 8, DXL_MAX_TORQUE = 14, DXL_TORQUE = 24, DXL_CW_MARGIN = 26, DXL_GOAL = 30,
       DXL_SPEED = 32, DXL_TORQUE_LIMIT = 34, DXL_POSITION = 36, DXL_PRESENT_SPEED = 38, DXL_LOAD = 40, DXL_VOLTS = 42,
       DXL_HEAT = 43, DXL_LOCK = 47, DXL_PUNCH = 48, DXL_END = 50 };

enum dxl_answer { DXL_OK, DXL_SILENT, DXL_CUT, DXL_GARBLED, DXL_FOREIGN };

/* Each writes a packet into `out` and returns its length. */
uint32_t dxl_blank(uint8_t *out, uint32_t count); /* zeros, which begin no packet, but end one */
uint32_t dxl_read(uint8_t *out, uint8_t id, uint8_t address, uint8_t count);
uint32_t dxl_write(uint8_t *out, uint8_t id, uint8_t address, const uint8_t *values, uint32_t count);
uint32_t dxl_sync_limits(uint8_t *out, const uint8_t *table, const uint16_t *limits);
uint32_t dxl_sync_goals(uint8_t *out, const uint8_t *table, const uint16_t *goals, const uint16_t *speeds);

/* Whether `n` bytes are the whole answer of `id` with `count` parameters (from in + 5) and nothing else. */
enum dxl_answer dxl_status(const uint8_t *in, uint32_t n, uint8_t id, uint32_t count);

/* Complement of the sum of a packet's `n` bytes, without header and checksum. */
uint8_t dxl_sum(const uint8_t *packet, uint32_t n);

#endif
