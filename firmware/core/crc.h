/* Check sums: CRC-32 (IEEE, as zlib) of tables, CRC-16 (CCITT, start 0xFFFF) of frames on the links. */
#ifndef CRC_H
#define CRC_H

#include "bytes.h"

#define CRC32_WITH_ITSELF 0x2144DF1Cu /* of any bytes with their own CRC-32 behind them */

/* Start with 0; the result of one stretch is the start of the next. */
uint32_t crc32(uint32_t crc, const uint8_t *bytes, uint32_t n);

/* Start with 0xFFFF. */
uint16_t crc16(uint16_t crc, uint8_t byte);

#endif
