#include "crc.h"

uint32_t crc32(uint32_t crc, const uint8_t *bytes, uint32_t n) {
    static const uint32_t nibble[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4, 0x4DB26158, 0x5005713C,
        0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C, 0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    crc = ~crc;
    for (uint32_t k = 0; k < n; k++) {
        crc = nibble[(crc ^ bytes[k]) & 15u] ^ crc >> 4;
        crc = nibble[(crc ^ (uint32_t)bytes[k] >> 4) & 15u] ^ crc >> 4;
    }
    return ~crc;
}

uint16_t crc16(uint16_t crc, uint8_t byte) {
    uint32_t x = ((uint32_t)crc >> 8 ^ byte) & 0xFFu;
    x ^= x >> 4;
    return (uint16_t)((uint32_t)crc << 8 ^ x << 12 ^ x << 5 ^ x);
}
